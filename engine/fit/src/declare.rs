//! How [`FitConfig`](crate::FitConfig) is declared: a list of keys with defaults and bounds, by subject. From it follow
//! the nested structs, the flat form that files have, and the check of each value by itself.

use std::fmt::Display;

use base::error::{Error, Kind, Result};

/// A value that is held against its bounds, each of which is a method.
pub(super) struct Checked<'a, T> {
    /// Key of the value in files.
    pub key: &'static str,
    /// Name of the value in its group, if that is not its key.
    pub name: &'static str,
    /// The value.
    pub value: &'a T,
}

/// Returns the error of a value that cannot work.
pub(super) fn wrong(key: &str, found: impl Display, needed: &str) -> Error {
    Error::new(Kind::Usage, "VGS-CFG-001", format!("{key} = {found}: {needed} is needed"))
}

/// Bounds of numbers; NaN is outside of all of them.
impl<T: Display + PartialOrd> Checked<'_, T> {
    fn needs(self, holds: bool, needed: &str) -> Result<Self> {
        if holds { Ok(self) } else { Err(wrong(self.key, self.value, needed)) }
    }

    /// Needs a value from `least` to `most`.
    pub fn within(self, least: T, most: T) -> Result<Self> {
        let needed = format!("{least} to {most}");
        let holds = (least..=most).contains(self.value);
        self.needs(holds, &needed)
    }

    /// Needs a number of voxels from `least` to `most`.
    pub fn voxels(self, least: T, most: T) -> Result<Self> {
        let needed = format!("{least} to {most} voxels");
        let holds = (least..=most).contains(self.value);
        self.needs(holds, &needed)
    }

    /// Needs a value from `low` to `high`, outside of which an initialiser makes no sense.
    pub fn initial(self, low: T, high: T) -> Result<Self> {
        let Checked { name, value, .. } = self;
        if (&low..=&high).contains(&value) {
            return Ok(self);
        }
        let message = format!("{name} is {value}; it must lie from {low} to {high}");
        Err(Error::new(Kind::Usage, "VGS-INIT-001", message))
    }
}

impl Checked<'_, f32> {
    /// Needs a finite number above 0.
    pub fn positive(self) -> Result<Self> {
        let holds = *self.value > 0.0 && self.value.is_finite();
        self.needs(holds, "a positive number")
    }

    /// Needs a finite number of `least` or more.
    pub fn at_least(self, least: f32) -> Result<Self> {
        let holds = *self.value >= least && self.value.is_finite();
        self.needs(holds, &format!("a number of at least {least}"))
    }

    /// Needs a number from 0 to 1, but not 1 itself.
    pub fn below_one(self) -> Result<Self> {
        let holds = (0.0..1.0).contains(self.value);
        self.needs(holds, "at least 0 and less than 1")
    }
}

impl Checked<'_, [f32; 2]> {
    /// Needs two finite numbers, the first below the second, or two zeros.
    pub fn rising(self) -> Result<Self> {
        let [low, high] = *self.value;
        if low.is_finite() && high.is_finite() && (low < high || [low, high] == [0.0, 0.0]) {
            return Ok(self);
        }
        Err(wrong(self.key, format!("{low},{high}"), "low,high with low < high"))
    }
}

/// Declares a configuration and the structs of its groups.
///
/// A value is `key: type = default`, and in a group that knows it by another name `key => name: type = default`; then
/// come its bounds, methods of [`Checked`]. A group follows a value of no group. Keys are unique in the whole
/// configuration, since files, flags and records have them side by side: that is `Flat`.
macro_rules! config {
    ($(#[$meta:meta])* pub struct $Config:ident {$(
        $(#[doc = $doc:literal])+
        $key:ident: $ty:ty = $default:expr $(, $bound:ident($($limit:expr),*))*;
        $(pub struct $Group:ident as $group:ident {
            $(#![doc = $about:literal])+
            $(
                $(#[doc = $its_doc:literal])+
                $its_key:ident
                $(: $same_ty:ty = $same_default:expr)?
                $(=> $name:ident: $its_ty:ty = $its_default:expr)?
                $(, $its_bound:ident($($its_limit:expr),*))*;
            )+
        })*
    )+}) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(from = "Flat", into = "Flat")]
        pub struct $Config {$(
            $(#[doc = $doc])+
            pub $key: $ty,
            $($(#[doc = $about])+ pub $group: $Group,)*
        )+}

        $($(
            $(#[doc = $about])+
            #[derive(Clone, Debug, PartialEq)]
            pub struct $Group {
                $($(#[doc = $its_doc])+ $(pub $its_key: $same_ty,)? $(pub $name: $its_ty,)?)+
            }

            impl Default for $Group {
                fn default() -> Self {
                    $Group { $($($its_key: $same_default,)? $($name: $its_default,)?)+ }
                }
            }
        )*)+

        impl Default for $Config {
            fn default() -> Self {
                $Config { $($key: $default, $($group: $Group::default(),)*)+ }
            }
        }

        impl $Config {
            /// The keys of all values in the order of their declaration.
            pub const FIELDS: &'static [Parameter] = &[$(
                Parameter { key: stringify!($key), doc: concat!($($doc),+) },
                $($(Parameter { key: stringify!($its_key), doc: concat!($($its_doc),+) },)+)*
            )+];

            /// Refuses values that are out of their bounds.
            fn check_each(&self) -> Result<()> {
                $(
                    let (key, name) = (stringify!($key), "");
                    Checked { key, name, value: &self.$key }$(.$bound($($limit),*)?)*;
                    $($(
                        let (key, name) = (stringify!($its_key), stringify!($($name)?));
                        let value = &config!(@place self.$group, $its_key $($name)?);
                        Checked { key, name, value }$(.$its_bound($($its_limit),*)?)*;
                    )+)*
                )+
                Ok(())
            }
        }

        /// All values by their keys, as files have them.
        #[derive(Serialize, Deserialize)]
        #[serde(rename = "FitConfig", deny_unknown_fields, default)]
        struct Flat { $($key: $ty, $($($its_key: $($same_ty)? $($its_ty)?,)+)*)+ }

        impl Default for Flat {
            fn default() -> Self {
                $Config::default().into()
            }
        }

        impl From<$Config> for Flat {
            fn from(config: $Config) -> Self {
                Flat {$(
                    $key: config.$key,
                    $($($its_key: config!(@place config.$group, $its_key $($name)?),)+)*
                )+}
            }
        }

        impl From<Flat> for $Config {
            fn from(flat: Flat) -> Self {
                let mut config = $Config::default();
                $(
                    config.$key = flat.$key;
                    $($(config!(@place config.$group, $its_key $($name)?) = flat.$its_key;)+)*
                )+
                config
            }
        }
    };
    (@place $group:expr, $key:ident) => { $group.$key };
    (@place $group:expr, $key:ident $name:ident) => { $group.$name };
}
pub(super) use config;
