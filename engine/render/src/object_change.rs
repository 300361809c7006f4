//! Changes of how objects appear, as flags of programs have them.

use std::str::FromStr;

use super::Look;
use base::error::Result;
use splat::Object;

/// Parses the colour #rrggbb: red, green, blue from 0 to 1; `None` for any other text.
pub fn hex_colour(text: &str) -> Option<[f32; 3]> {
    let digits = text.strip_prefix('#').filter(|d| d.len() == 6 && d.is_ascii())?;
    let byte = |i: usize| u8::from_str_radix(&digits[i..i + 2], 16).ok().map(|b| f32::from(b) / 255.0);
    Some([byte(0)?, byte(2)?, byte(4)?])
}

/// Parses a factor of the opacity.
fn opacity_of(text: &str) -> std::result::Result<f32, String> {
    let found = text.trim().parse().ok().filter(|v| (0.0..=1.0).contains(v));
    found.ok_or_else(|| "a number from 0 to 1 is needed".into())
}

/// A change of the appearance of all objects with a name, as a flag has it: NAME:colour=#rrggbb,opacity=0.4,
/// NAME:tf=CT-Bone, or NAME:hidden.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectChange {
    name: String,
    hidden: bool,
    colour: Option<[f32; 3]>,
    opacity: Option<f32>,
    /// A preset or a file.
    function: Option<String>,
}

impl FromStr for ObjectChange {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || {
            "NAME:colour=#rrggbb,opacity=0.4, NAME:tf=CT-Bone or NAME:hidden; NAME is a name or a number"
                .to_owned()
        };
        let (name, words) = text.rsplit_once(':').ok_or_else(wrong)?;
        let mut change = ObjectChange::hiding(name);
        change.hidden = false;
        for word in words.split(',').map(str::trim) {
            match word.split_once('=') {
                None if word == "hidden" => change.hidden = true,
                Some(("colour" | "color", colour)) => {
                    change.colour = Some(hex_colour(colour).ok_or("a colour is #rrggbb")?);
                }
                Some(("tf", function)) => change.function = Some(function.trim().to_owned()),
                Some(("opacity", opacity)) => change.opacity = Some(opacity_of(opacity)?),
                _ => return Err(wrong()),
            }
        }
        Ok(change)
    }
}

impl ObjectChange {
    /// Returns the change that hides the objects of a name.
    pub fn hiding(name: &str) -> Self {
        ObjectChange {
            name: name.trim().to_owned(),
            hidden: true,
            colour: None,
            opacity: None,
            function: None,
        }
    }

    /// Returns true if it gives objects a transfer function of their own.
    pub fn has_function(&self) -> bool {
        self.function.is_some()
    }

    /// Returns true if it changes the colour, the opacity or the function of objects.
    pub fn changes_colour(&self) -> bool {
        self.function.is_some() || self.colour.is_some() || self.opacity.is_some()
    }

    /// Changes the appearances and the transfer functions in a look of all objects that it names: by number, by name,
    /// or by the part of the name before or after its slash. `range` is that of the intensities that are shown, for
    /// presets that are stretched over it.
    ///
    /// # Errors
    /// [`Kind::Usage`](base::Kind::Usage) if no object is called so; the help names those that there are. Returns the errors of
    /// [`transfer::load`].
    pub fn apply(&self, objects: &[Object], look: &mut Look, range: [f64; 2]) -> Result<()> {
        let function = self.function.as_deref().map(|name| transfer::load(name, range)).transpose()?;
        for object in Object::called(objects, &self.name)? {
            if let Some(function) = &function {
                look.functions.insert(object.number, function.clone());
            }
            let appearance = look.objects.entry(object.number).or_default();
            appearance.visible &= !self.hidden;
            appearance.tint = self.colour.or(appearance.tint);
            appearance.opacity = self.opacity.unwrap_or(appearance.opacity);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::Appearance;

    const RANGE: [f64; 2] = [-1000.0, 2000.0];

    fn plain() -> Look {
        Look::new(transfer::load("CT-Skin", RANGE).expect("a preset"))
    }

    #[test]
    fn objects_are_changed_by_number_name_and_part_of_a_name() {
        let names = ["bones", "organs/liver", "organs/label 5"];
        let object = |(number, name): (u8, &&str)| Object { number, name: (*name).to_owned(), splats: 1 };
        let objects: Vec<_> = (1..).zip(&names).map(object).collect();
        let changed = |texts: &[&str]| {
            let mut look = plain();
            for text in texts {
                let change: ObjectChange = text.parse().unwrap_or_else(|e| panic!("{text}: {e}"));
                change.apply(&objects, &mut look, RANGE).unwrap_or_else(|e| panic!("{text}: {e}"));
            }
            look.objects
        };
        let red = Appearance { tint: Some([1.0, 0.0, 0.0]), opacity: 0.5, visible: true };
        for text in ["1:colour=#ff0000,opacity=0.5", " Bones : opacity=0.5, color=#FF0000"] {
            assert_eq!(changed(&[text]), BTreeMap::from([(1, red)]), "{text}");
        }
        let hidden = Appearance { visible: false, ..Appearance::default() };
        assert_eq!(changed(&["organs:hidden"]), BTreeMap::from([(2, hidden), (3, hidden)]));
        assert_eq!(changed(&["label 5:hidden"]), BTreeMap::from([(3, hidden)]));
        // Changes are made one after the other; the later ones win.
        let both = Appearance { opacity: 0.25, visible: false, ..red };
        assert_eq!(
            changed(&["liver:colour=#ff0000,opacity=0.5", "organs/liver:opacity=0.25,hidden"]),
            BTreeMap::from([(2, both)])
        );
        for text in ["", "1", "1:", "1:red", "1:colour=red", "1:opacity=2", "1:opacity=nan", "1:hidden=yes"] {
            assert!(text.parse::<ObjectChange>().is_err(), "{text}");
        }
        let change: ObjectChange = "organs:tf=CT-Bone".parse().expect("a change");
        let mut look = plain();
        change.apply(&objects, &mut look, RANGE).expect("two objects");
        assert_eq!(look.functions.keys().copied().collect::<Vec<_>>(), [2, 3]);
        assert_eq!(look.functions[&3].name, "CT-Bone");
        let unknown: ObjectChange = "bones:tf=CT-Boat".parse().expect("a change");
        assert!(unknown.apply(&objects, &mut look, RANGE).is_err() && look.functions.len() == 2);
        for name in ["5", "heart", ""] {
            let error = ObjectChange::hiding(name).apply(&objects, &mut plain(), RANGE).expect_err(name);
            assert!(
                error.code == "VGS-SPLAT-010" && error.help.contains("organs/liver (2)"),
                "{}",
                error.help
            );
        }
    }
}
