//! What intensities are numbers of.

/// Unit of the intensities of a volume, of splats, or of the control points of a preset.
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

impl Unit {
    /// Returns the unit that is called so in files; `None` if there is none.
    pub fn from_name(name: &str) -> Option<Self> {
        [Unit::Hu, Unit::Arbitrary, Unit::Luminance].into_iter().find(|unit| unit.name() == name)
    }

    /// Returns its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Unit::Hu => "hu",
            Unit::Arbitrary => "arbitrary",
            Unit::Luminance => "luminance",
        }
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
    pub fn joined(self, other: Unit) -> Unit {
        match (self, other) {
            (Unit::Luminance, _) | (_, Unit::Luminance) => Unit::Luminance,
            (a, b) if a == b => a,
            _ => Unit::Arbitrary,
        }
    }
}
