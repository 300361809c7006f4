//! What the intensities of splats are numbers of.

/// Unit of the intensities of a set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// Hounsfield units, of a CT.
    #[default]
    Hu,
    /// None: the scan has no scale of its own, as an MR.
    Arbitrary,
    /// The luminance of a colour, about 0 to 1, for which a transfer function means nothing.
    Luminance,
}

/// All units with their names in files.
const UNITS: [(Unit, &str); 3] =
    [(Unit::Hu, "hu"), (Unit::Arbitrary, "arbitrary"), (Unit::Luminance, "luminance")];

impl Unit {
    /// Returns the unit that is called so in files; `None` if there is none.
    pub fn from_name(name: &str) -> Option<Self> {
        UNITS.iter().find(|(_, own)| *own == name).map(|(unit, _)| *unit)
    }

    /// Returns its name in files.
    pub fn name(self) -> &'static str {
        UNITS.iter().find(|(unit, _)| *unit == self).map_or("", |(_, name)| name)
    }

    /// Returns the unit to write after an intensity: " HU", or nothing.
    pub fn text(self) -> &'static str {
        if self == Unit::Hu { " HU" } else { "" }
    }

    /// Returns true if intensities are those of a scan, and not luminances.
    pub fn is_physical(self) -> bool {
        self != Unit::Luminance
    }

    /// Returns the unit of this and another set together.
    pub(super) fn joined(self, other: Unit) -> Unit {
        match (self, other) {
            (Unit::Luminance, _) | (_, Unit::Luminance) => Unit::Luminance,
            (a, b) if a == b => a,
            _ => Unit::Arbitrary,
        }
    }
}
