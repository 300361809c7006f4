//! Presets: transfer functions with a name.
//!
//! Names are those that users know from other programs; control points are our own. CT has Hounsfield units,
//! so its presets stand where they stand. MR has no unit: its presets are in shares of the range of the data.

use glam::DVec3;

use super::{ColourPoint, MAX_INTENSITY, Material, OpacityPoint, TransferFunction};
use base::error::{Error, Kind, Result};
use base::names;
use base::unit::Unit;

/// A transfer function with a name, a row of [`PRESETS`].
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Name, in the usual spelling.
    pub name: &'static str,
    /// Description in one line.
    pub about: &'static str,
    /// The unit of the intensities of its control points: HU, for CT; or none, and they are shares of the range of the
    /// data, 0 to 1, for MR and for anything else.
    pub unit: Unit,
    /// Intensity, and red, green, blue.
    colours: &'static [(f64, [f64; 3])],
    /// Intensity, and opacity per millimetre.
    opacities: &'static [(f64, f64)],
    material: Material,
}

const fn shaded(ambient: f64, diffuse: f64, specular: f64, power: f64) -> Material {
    Material { shade: true, ambient, diffuse, specular, power, occlusion: 0.0 }
}

/// Surfaces that shine like wet bone.
const GLOSSY: Material = shaded(0.15, 0.85, 0.25, 20.0);
/// Surfaces with a weak highlight.
const SOFT: Material = shaded(0.25, 0.8, 0.1, 8.0);
/// Colours without shading.
const FLAT: Material = Material { shade: false, ..shaded(1.0, 0.0, 0.0, 1.0) };

/// Name of the preset with which programs begin.
pub const FIRST: &str = "CT-Bone";
/// Name of the preset for volumes without HU.
pub const FIRST_WITHOUT_HU: &str = "MR-Default";

/// Returns the name of the preset with which intensities of a unit are shown at first.
pub fn first(unit: Unit) -> &'static str {
    if unit == Unit::Arbitrary { FIRST_WITHOUT_HU } else { FIRST }
}

/// All presets, in the order in which they are shown to people.
pub const PRESETS: &[Preset] = &[
    Preset {
        name: "CT-Bone",
        about: "bone with its marrow, from translucent cancellous to opaque cortical",
        unit: Unit::Hu,
        colours: &[
            (120.0, [0.60, 0.24, 0.16]),
            (260.0, [0.83, 0.56, 0.36]),
            (500.0, [0.93, 0.84, 0.66]),
            (1200.0, [1.0, 0.98, 0.92]),
        ],
        opacities: &[(120.0, 0.0), (220.0, 0.03), (400.0, 0.30), (800.0, 0.65), (1500.0, 0.80)],
        material: GLOSSY,
    },
    Preset {
        name: "CT-Bones-Steep",
        about: "the surface of bone: transparent below 150 HU, opaque from 300 HU on",
        unit: Unit::Hu,
        colours: &[
            (150.0, [0.74, 0.46, 0.30]),
            (300.0, [0.91, 0.80, 0.62]),
            (700.0, [0.97, 0.93, 0.83]),
            (1500.0, [1.0, 1.0, 0.97]),
        ],
        opacities: &[(150.0, 0.0), (300.0, 0.80), (1000.0, 0.95)],
        material: GLOSSY,
    },
    Preset {
        name: "CT-Soft-Tissue",
        about: "translucent: a breath of fat, then organs, contrast medium and bone",
        unit: Unit::Hu,
        colours: &[
            (-100.0, [0.95, 0.82, 0.52]),
            (-10.0, [0.93, 0.72, 0.50]),
            (20.0, [0.72, 0.32, 0.26]),
            (90.0, [0.82, 0.40, 0.32]),
            (150.0, [0.93, 0.30, 0.22]),
            (300.0, [0.98, 0.82, 0.66]),
            (900.0, [1.0, 0.99, 0.95]),
        ],
        opacities: &[
            (-120.0, 0.0),
            (-90.0, 0.003),
            (-20.0, 0.003),
            (20.0, 0.012),
            (90.0, 0.02),
            (150.0, 0.05),
            (300.0, 0.12),
            (900.0, 0.30),
        ],
        material: SOFT,
    },
    Preset {
        name: "CT-Angio",
        about: "vessels with contrast medium in red, bone in white",
        unit: Unit::Hu,
        colours: &[
            (130.0, [0.55, 0.10, 0.08]),
            (220.0, [0.86, 0.22, 0.14]),
            (350.0, [0.96, 0.55, 0.35]),
            (500.0, [0.97, 0.88, 0.76]),
            (1200.0, [1.0, 1.0, 0.97]),
        ],
        opacities: &[(130.0, 0.0), (170.0, 0.12), (260.0, 0.55), (450.0, 0.70), (1200.0, 0.85)],
        material: GLOSSY,
    },
    Preset {
        name: "CT-Muscle",
        about: "muscle and tendons under transparent fat, over bone",
        unit: Unit::Hu,
        colours: &[
            (-40.0, [0.62, 0.26, 0.20]),
            (60.0, [0.74, 0.30, 0.24]),
            (140.0, [0.90, 0.62, 0.48]),
            (300.0, [0.95, 0.88, 0.74]),
            (1000.0, [1.0, 1.0, 0.96]),
        ],
        opacities: &[(-30.0, 0.0), (20.0, 0.10), (70.0, 0.35), (200.0, 0.55), (500.0, 0.75)],
        material: SOFT,
    },
    Preset {
        name: "CT-Lung",
        about: "lung tissue, airways and their vessels; the body wall is left out",
        unit: Unit::Hu,
        colours: &[
            (-950.0, [0.25, 0.42, 0.62]),
            (-800.0, [0.55, 0.72, 0.86]),
            (-600.0, [0.90, 0.72, 0.66]),
            (-350.0, [0.86, 0.42, 0.36]),
        ],
        opacities: &[
            (-950.0, 0.0),
            (-850.0, 0.004),
            (-700.0, 0.015),
            (-500.0, 0.10),
            (-350.0, 0.05),
            (-300.0, 0.0),
        ],
        material: SOFT,
    },
    Preset {
        name: "CT-Skin",
        about: "the skin alone: a band of 60 HU between air and fat",
        unit: Unit::Hu,
        colours: &[(-180.0, [0.88, 0.66, 0.54]), (-120.0, [0.96, 0.80, 0.69])],
        opacities: &[(-180.0, 0.0), (-150.0, 0.80), (-120.0, 0.0)],
        material: SOFT,
    },
    Preset {
        name: "CT-Liver-Vasculature",
        about: "vessels of a liver with contrast medium, in a haze of its tissue",
        unit: Unit::Hu,
        colours: &[
            (70.0, [0.45, 0.22, 0.16]),
            (120.0, [0.58, 0.28, 0.18]),
            (160.0, [0.32, 0.44, 0.78]),
            (220.0, [0.66, 0.76, 0.95]),
            (500.0, [0.97, 0.95, 0.90]),
        ],
        opacities: &[(70.0, 0.0), (110.0, 0.006), (140.0, 0.02), (170.0, 0.45), (250.0, 0.60), (800.0, 0.75)],
        material: GLOSSY,
    },
    Preset {
        name: "CT-Fat",
        about: "fat alone, -120 to -50 HU",
        unit: Unit::Hu,
        colours: &[(-120.0, [0.97, 0.90, 0.58]), (-85.0, [0.98, 0.80, 0.36]), (-50.0, [0.90, 0.58, 0.28])],
        opacities: &[(-125.0, 0.0), (-110.0, 0.12), (-60.0, 0.12), (-45.0, 0.0)],
        material: SOFT,
    },
    Preset {
        name: "CT-X-Ray",
        about: "grey and translucent throughout, as on a radiograph",
        unit: Unit::Hu,
        colours: &[(-800.0, [0.0; 3]), (0.0, [0.45; 3]), (300.0, [0.80; 3]), (1200.0, [1.0; 3])],
        opacities: &[(-800.0, 0.0), (-100.0, 0.0006), (100.0, 0.002), (300.0, 0.008), (1500.0, 0.04)],
        material: FLAT,
    },
    Preset {
        name: "MR-Default",
        about: "brightness and opacity grow together, over the range of the data",
        unit: Unit::Arbitrary,
        colours: &[
            (0.05, [0.10, 0.04, 0.02]),
            (0.15, [0.45, 0.20, 0.12]),
            (0.40, [0.80, 0.62, 0.42]),
            (0.75, [0.93, 0.88, 0.80]),
            (1.0, [1.0; 3]),
        ],
        opacities: &[(0.05, 0.0), (0.12, 0.03), (0.35, 0.12), (0.70, 0.25), (1.0, 0.40)],
        material: SOFT,
    },
    Preset {
        name: "MR-T1-Brain",
        about: "grey and white matter of a T1-weighted head",
        unit: Unit::Arbitrary,
        colours: &[
            (0.15, [0.42, 0.26, 0.22]),
            (0.32, [0.72, 0.55, 0.50]),
            (0.50, [0.92, 0.85, 0.78]),
            (0.80, [1.0, 0.97, 0.90]),
        ],
        opacities: &[(0.18, 0.0), (0.28, 0.10), (0.45, 0.45), (0.65, 0.60), (1.0, 0.60)],
        material: SOFT,
    },
    Preset {
        name: "MR-Angio",
        about: "the brightest fifth of the data: flowing blood in time-of-flight MR",
        unit: Unit::Arbitrary,
        colours: &[(0.30, [0.50, 0.08, 0.06]), (0.50, [0.88, 0.30, 0.18]), (0.80, [1.0, 0.86, 0.70])],
        opacities: &[(0.35, 0.0), (0.45, 0.25), (0.60, 0.60), (1.0, 0.75)],
        material: GLOSSY,
    },
    Preset {
        name: "Grey",
        about: "a linear grey ramp over the range of the data",
        unit: Unit::Arbitrary,
        colours: &[(0.0, [0.0; 3]), (1.0, [1.0; 3])],
        opacities: &[(0.0, 0.0), (1.0, 0.10)],
        material: FLAT,
    },
];

impl Preset {
    /// Returns the transfer function of the preset. `data` is the least and the greatest intensity of what is
    /// shown, for presets in shares of that range.
    pub fn over(&self, data: [f64; 2]) -> TransferFunction {
        let (low, width) = match self.unit {
            Unit::Hu => (0.0, 1.0),
            Unit::Arbitrary | Unit::Luminance => range_of(data),
        };
        let place = |v: f64| low + v * width;
        let colours = self
            .colours
            .iter()
            .map(|&(v, colour)| ColourPoint { intensity: place(v), colour: DVec3::from_array(colour) });
        let opacities =
            self.opacities.iter().map(|&(v, opacity)| OpacityPoint { intensity: place(v), opacity });
        TransferFunction::new(self.name, colours.collect(), opacities.collect(), self.material)
            .expect("a test makes every preset")
    }
}

/// Returns the low end and the width of the range of some data; constant data count as 1 wide.
fn range_of(data: [f64; 2]) -> (f64, f64) {
    let [low, high] = data.map(|v| if v.is_nan() { 0.0 } else { v.clamp(-MAX_INTENSITY, MAX_INTENSITY) });
    if low < high { (low, high - low) } else { (low, 1.0) }
}

/// Returns the preset called `name`, in either case.
///
/// # Errors
/// [`Kind::Usage`] for an unknown name, with the known names and the nearest of them.
pub fn preset(name: &str) -> Result<&'static Preset> {
    PRESETS.iter().find(|p| p.name.eq_ignore_ascii_case(name)).ok_or_else(|| {
        let message = format!("there is no transfer function {name:?}");
        Error::new(Kind::Usage, "VGS-TF-006", message).help(known_names(name))
    })
}

/// Returns advice for a user who asked for an unknown preset.
pub(super) fn known_names(asked: &str) -> String {
    let known: Vec<_> = PRESETS.iter().map(|p| p.name).collect();
    format!("{}presets are {}", names::meant(asked, known.iter().copied()), known.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_ones_are_there() {
        assert!(preset(FIRST).is_ok() && preset(FIRST_WITHOUT_HU).is_ok());
    }

    #[test]
    fn every_preset_is_a_function_that_shows_something() {
        for (i, preset) in PRESETS.iter().enumerate() {
            let data = [-200.0, 1800.0];
            let tf = preset.over(data);
            let [low, high] = tf.visible().expect(preset.name);
            assert_eq!(tf.name, preset.name);
            assert!(low.is_finite(), "{}: air is transparent", preset.name);
            match preset.unit {
                Unit::Hu => assert!(low >= -1000.0, "{}", preset.name),
                Unit::Arbitrary | Unit::Luminance => {
                    assert!(
                        low >= data[0] && tf.extent()[1] <= data[1] && high.is_infinite(),
                        "{}",
                        preset.name
                    );
                }
            }
            assert!(!preset.about.is_empty() && !preset.about.contains('\n'));
            assert!(
                PRESETS[..i].iter().all(|p| !p.name.eq_ignore_ascii_case(preset.name)),
                "{} twice",
                preset.name
            );
        }
        assert_eq!(preset("ct-skin").unwrap().over([0.0, 1.0]).visible(), Some([-180.0, -120.0]));
    }

    #[test]
    fn presets_in_shares_survive_odd_data() {
        let grey = preset("GREY").unwrap();
        let huge = f64::from(f32::MAX);
        for data in
            [[5.0, 5.0], [3.0, 1.0], [f64::NAN, 1.0], [-huge, huge], [f64::NEG_INFINITY, f64::INFINITY]]
        {
            assert!(grey.over(data).visible().is_some(), "{data:?}");
        }
        assert_eq!(grey.over([5.0, 5.0]).extent(), [5.0, 6.0]);
        assert!((grey.over([100.0, 300.0]).at(200.0).1 - 0.05).abs() < 1e-12);
    }

    #[test]
    fn an_unknown_name_is_told_the_names() {
        let error = preset("ct-bons").unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-TF-006"));
        assert!(error.help.starts_with("did you mean CT-Bone?"), "{}", error.help);
        assert!(PRESETS.iter().all(|p| error.help.contains(p.name)));
        assert!(!preset("something else").unwrap_err().help.contains("did you mean"));
    }
}
