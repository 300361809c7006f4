//! The table of the ways to render a scene.

use super::alpha::Alpha;
use super::decoded::DecodeOptions;
use super::gpu_splats::GpuSplats;
use super::mode::Mode;
use super::raymarch::Raymarch;
use super::scene::Scene;
use super::settings::Settings;
use super::slab::Slab;
use super::splat_kind::SplatKind;
use base::error::{Error, Kind, Result};
use base::names;
use gpu::Gpu;

/// A row of [`MODES`].
pub struct ModeRow {
    /// Name on the command line and in tables.
    pub name: &'static str,
    /// Description in one line.
    pub about: &'static str,
    /// True if it renders splats rather than the volume.
    pub of_splats: bool,
    /// True if objects may have transfer functions of their own there; in other modes that of the scene is theirs.
    pub own_functions: bool,
    /// True if its light knows ambient occlusion ([`transfer::Material::occlusion`]).
    pub occlusion: bool,
    /// True if the opacity may depend on the gradient ([`transfer::TransferFunction::gradient_opacities`]).
    pub gradient_opacity: bool,
    /// [`Settings::step`] of a finished picture.
    pub step: f64,
    /// What the step is a distance of; `None` if users have no choice of it.
    pub step_of: Option<StepOf>,
    /// What splats must have on the device before the mode shows them at once.
    pub needs: Needs,
    /// The splats whose quality levels keep it within a frame budget.
    pub levels: SplatKind,
    make: fn(&Gpu, &Scene, &Settings) -> Result<Box<dyn Mode>>,
}

/// What the step of a mode is a distance of, and in what unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepOf {
    /// Samples along a ray, in voxel edges.
    Samples,
    /// Slabs of splats, in [`GpuSplats::sigma_mm`](super::GpuSplats::sigma_mm).
    Slabs,
}

/// What splats must have on the device before a mode shows them at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing but themselves.
    Splats,
    /// Their faces and points ([`GpuSplats::preparation`](super::GpuSplats::preparation)).
    Faces,
    /// Their decoded field ([`GpuSplats::decoding`](super::GpuSplats::decoding)).
    DecodedField,
}

impl Needs {
    /// Returns true if splats have it; the field decoded so ([`Settings::decoding`]).
    pub fn are_met(self, splats: &GpuSplats, decoding: DecodeOptions) -> bool {
        match self {
            Needs::Splats => true,
            Needs::Faces => splats.has_faces(),
            Needs::DecodedField => splats.has_decoded(decoding),
        }
    }
}

/// The mode in which splats are shown while what another one [needs](Needs) is made.
pub const MEANWHILE: &str = "slab";

/// The mode that shows a volume where none is asked for.
pub const OF_VOLUMES: &str = "volume";

impl ModeRow {
    /// Creates the mode. Fails if the scene lacks what the mode renders.
    pub(super) fn make(&self, gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Box<dyn Mode>> {
        let there = if self.of_splats { scene.splats.is_some() } else { scene.volume.is_some() };
        if !there {
            let needed = if self.of_splats { "splats" } else { "a volume" };
            return Err(Error::new(
                Kind::Usage,
                "VGS-RENDER-003",
                format!("mode {} needs {needed}, and the scene has none", self.name),
            )
            .help("choose another --mode, or give what is missing"));
        }
        (self.make)(gpu, scene, settings)
    }
}

/// The modes, in the order in which programs offer them.
pub static MODES: [ModeRow; 5] = [
    ModeRow {
        name: "volume",
        about: "the CT itself, ray-marched with trilinear sampling: the reference",
        of_splats: false,
        own_functions: false,
        occlusion: true,
        gradient_opacity: true,
        step: 0.2,
        step_of: Some(StepOf::Samples),
        needs: Needs::Splats,
        levels: SplatKind::Grid,
        make: |gpu, scene, settings| Ok(Box::new(Raymarch::new(gpu, scene, settings)?)),
    },
    ModeRow {
        name: "decoded",
        about: "the splats' field on the CT's own voxels, put there once, and ray-marched as those",
        of_splats: true,
        own_functions: true,
        occlusion: true,
        gradient_opacity: true,
        step: 0.2,
        step_of: Some(StepOf::Samples),
        needs: Needs::DecodedField,
        levels: SplatKind::Grid,
        make: |gpu, scene, settings| Ok(Box::new(Raymarch::decoded(gpu, scene, settings)?)),
    },
    ModeRow {
        name: "slab",
        about: "the splats' field in slabs, classified after it is added up",
        of_splats: true,
        own_functions: false,
        occlusion: false,
        gradient_opacity: false,
        step: 0.5,
        step_of: Some(StepOf::Slabs),
        needs: Needs::Splats,
        levels: SplatKind::Field,
        make: |gpu, scene, settings| Ok(Box::new(Slab::new(gpu, scene, settings)?)),
    },
    ModeRow {
        name: "exact",
        about: "the splats' field in steps of a tenth of a standard deviation",
        of_splats: true,
        own_functions: false,
        occlusion: false,
        gradient_opacity: false,
        step: 1.0,
        step_of: None,
        needs: Needs::Splats,
        levels: SplatKind::Field,
        make: |gpu, scene, settings| Ok(Box::new(Slab::exact(gpu, scene, settings)?)),
    },
    ModeRow {
        name: "alpha",
        about: "sorted splats, each of one colour, blended: the fastest",
        of_splats: true,
        own_functions: false,
        occlusion: false,
        gradient_opacity: false,
        step: 1.0,
        step_of: None,
        needs: Needs::Faces,
        levels: SplatKind::Coloured,
        make: |gpu, scene, settings| Ok(Box::new(Alpha::new(gpu, scene, settings)?)),
    },
];

/// Returns the row of the mode called `name`.
pub fn mode(name: &str) -> Result<&'static ModeRow> {
    MODES.iter().find(|m| m.name == name).ok_or_else(|| {
        let known: Vec<_> = MODES.iter().map(|m| m.name).collect();
        Error::new(Kind::Usage, "VGS-RENDER-002", format!("there is no mode {name:?}")).help(format!(
            "{}modes are {}",
            names::meant(name, known.iter().copied()),
            known.join(", ")
        ))
    })
}
