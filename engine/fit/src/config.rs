//! Every hyper-parameter of a fit. Each is one documented field, which is also the key of a configuration
//! file and the flag of a command line (`rate_mean` ↔ `--rate-mean`).

use serde::{Deserialize, Serialize};

use super::init::{INITIALISERS, InitConfig, Initialiser, ORIENTATIONS, Orientation};
use super::unit::ScaleUnit;
use base::error::{Error, Kind, Result};
pub use passes::Storage;
use splat::Kernel;
use volume::{BetweenSlices, Roi, Volume};

/// A field of [`FitConfig`] as programs show it.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Key in a file; the flag has `-` for `_`.
    pub key: &'static str,
    /// Description, with the unit.
    pub doc: &'static str,
}

/// Intensity of the field where no splat reaches; inside a fit, intensities are relative to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Background {
    /// The mean of the ROI.
    Mean,
    /// The lower end of the HU range: equation (2) to the letter.
    Low,
}

/// Places where the field of a fit must match the volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FitForm {
    /// At the voxels: the field is decoded there and interpolated, as a picture shows it.
    Grid,
    /// Everywhere, at sub-voxel offsets too.
    Field,
}

/// Range that intensities are clipped to, and whose span is the unit of the loss, if the configuration gives
/// no numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum IntensityRange {
    /// -1024..3071 for a CT (minimum below -200), and the range of the volume otherwise.
    Auto,
    /// From the least to the greatest intensity in the region.
    Roi,
}

/// Least rate of the means with which the trials of a goal, of a hundred iterations, say anything of a whole fit;
/// those of the paper have a two-thousandth of the default one.
const LEAST_RATE_WITH_GOAL: f32 = 0.05;

macro_rules! config {
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[doc = $doc:literal])+ $field:ident: $ty:ty = $default:expr,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name { $($(#[doc = $doc])+ pub $field: $ty,)* }

        impl Default for $name {
            fn default() -> Self {
                $name { $($field: $default,)* }
            }
        }

        impl $name {
            /// All fields in the order of the struct.
            pub const FIELDS: &'static [Parameter] =
                &[$(Parameter { key: stringify!($field), doc: concat!($($doc),+) },)*];
        }
    };
}

config! {
    /// Hyper-parameters of a fit; the default is the profile `default` of `docs/design/method.md`.
    pub struct FitConfig {
        /// Iterations of the optimiser.
        iterations: u32 = 300,
        /// Splats per ROI voxel, when their number is not given.
        density: f64 = 0.1,
        /// Number of splats; 0 takes it from the density.
        splats: usize = 0,
        /// PSNR at the voxels of the region that is to be reached, dB: the number of splats is then what that
        /// takes; 0: no such goal.
        target_psnr: f32 = 0.0,
        /// Error that 99 % of the voxels of the region are to stay within, HU: the number of splats is then what
        /// that takes; 0: no such goal.
        target_hu: f32 = 0.0,
        /// Most times that splats are added where a finished fit misses its goal; 0: the number that short
        /// trials have found is final.
        target_rounds: u32 = 5,
        /// The most splats, whatever else says how many; 0: no limit but one for each voxel with a target.
        max_splats: usize = 0,
        /// Seed of everything random; the same seed gives the same bits on the same device.
        seed: u64 = 0,
        /// Fits to volume and mask averaged over blocks of this many voxels along each axis; 1: to the voxels
        /// themselves.
        working_grid: u32 = 1,
        /// What lies between slices that are much thicker than their pixels: "smooth", other slices, intensities by
        /// a cubic and masks by their shape, on whose finer grid the splats are fitted; or "linear", nothing.
        between_slices: BetweenSlices = BetweenSlices::Smooth,
        /// Splat kernel: "compact" (1-q/6)^3, "gaussian" exp(-q/2) for ordinary viewers, or "density", the
        /// Gaussian of unit integral.
        kernel: Kernel = Kernel::Compact,
        /// How splats are placed first: "gradient" (blue noise, denser where the intensity changes) or
        /// "uniform" (at random, the mask being the probability, with random scales).
        initialiser: String = INITIALISERS[0].name.to_owned(),
        /// Initialiser: exponent of the gradient in the density; 0 is an even density.
        init_gradient_exponent: f32 = 0.7,
        /// Initialiser: added to the gradient, in units of its mean, so that even regions get splats too.
        init_gradient_floor: f32 = 0.1,
        /// Initialiser: standard deviation of the smoothing before and after the gradient, voxels.
        init_smoothing: f32 = 0.8,
        /// Initialiser: what turns the splats: "gradient" (thin across an edge), "structure-tensor",
        /// "hessian" (long along a vessel) or "none".
        init_orientation: String = ORIENTATIONS[0].name.to_owned(),
        /// Initialiser: scale across the gradient over scale along it is this to the power 3/2.
        init_anisotropy: f32 = 1.5,
        /// Initialiser: scale over the mean distance of the four nearest neighbours.
        init_scale: f32 = 0.6,
        /// Initialiser: least scale before it is flattened, voxels; "uniform" draws all scales from this one
        /// ...
        init_scale_min: f32 = 0.45,
        /// Initialiser: ... to the greatest.
        init_scale_max: f32 = 8.0,
        /// Initialiser: opacity of every splat, 0 to 1.
        init_opacity: f32 = 0.5,
        /// Initialiser: opacity of every splat is the mask at its centre instead.
        init_opacity_mask: bool = false,
        /// Intensities are clipped to this range (HU); the span is the unit of the loss. [0, 0] leaves it to
        /// `range`.
        hu_range: [f32; 2] = [0.0, 0.0],
        /// What hu_range [0, 0] stands for: "auto" (-1024..3071 for a CT, whose minimum is below -200, and
        /// the range of the volume otherwise) or "roi" (that of the region, which the figures at the end then
        /// count in, too).
        range: IntensityRange = IntensityRange::Auto,
        /// Which voxels are the region: 0: the mask weighs them (a binary one above one half); above 0: those
        /// whose mask is above this, all alike, and Dice and its kin look at no others.
        region_threshold: f32 = 0.0,
        /// Initialiser: from this scale on (geometric mean, voxels) a splat takes the mean intensity of the
        /// voxels within one standard deviation; 0: every splat takes that of its centre.
        init_footprint: f32 = 0.0,
        /// What the initial scales and the clamps of the scales count in: "voxel"; "spacing", the mean voxel
        /// spacing; or "box", where splats are shaped in the unit cube that the volume's box becomes
        /// (rate_mean counts in it, too).
        scale_unit: ScaleUnit = ScaleUnit::Voxel,
        /// What stands where no splat reaches: the "mean" of the ROI, or "low", the lower end of hu_range.
        background: Background = Background::Mean,
        /// Weight of the intensity error inside the ROI.
        mse_weight: f32 = 1.0,
        /// The intensity error: "mse", or "dice", "tversky", "kl" between intensities in 0..1.
        intensity_loss: String = "mse".to_owned(),
        /// Weight of the loss between 1 - exp(-W) and the mask over ROI and shell; 0 switches the term off.
        mask_weight: f32 = 0.0,
        /// The loss of the mask: "dice", "mse", "tversky" or "kl".
        mask_loss: String = "dice".to_owned(),
        /// Added to both sums of Dice, and twice that to those of Tversky, so that nothing is divided by
        /// nothing.
        dice_smoothing: f32 = 0.0,
        /// Weight of the mean of 1 - exp(-W) outside the ROI, in the shell; 0 switches the term off.
        leak_weight: f32 = 0.0,
        /// Power of 1 - exp(-W) in that mean, 1 or 2.
        leak_power: u32 = 1,
        /// Whether that mean is over all voxels of the volume outside the ROI. The shell must hold whatever a
        /// splat reaches.
        leak_volume: bool = false,
        /// Weight of the mean length of a splat's three scales, in scale_unit (in edges of the cube where
        /// that is "box"), beside the mean intensity error; 0 switches the term off.
        scale_weight: f32 = 0.0,
        /// Weight of the occupancy error over ROI and shell, for form "field" or a soft mask; 0 switches the term
        /// off.
        occupancy_weight: f32 = 0.004,
        /// The same for form "grid" and a binary mask, over ROI and a shell of one voxel: the file has the region
        /// exactly, and this only keeps splats from reaching far beyond it, for modes and programs that draw
        /// them as they are.
        hold_weight: f32 = 0.0001,
        /// w0 of the occupancy O = W / (W + w0), in units of the summed weight W.
        occupancy_w0: f32 = 0.05,
        /// An occupancy error up to this costs nothing, for form "grid" and a binary mask, 0 to 0.49.
        occupancy_tolerance: f32 = 0.4,
        /// Thickness of the shell around the ROI that occupancy, Dice and leak look at, voxels along each
        /// axis.
        shell: u32 = 4,
        /// Whether the shell goes on beyond the faces of the volume, where nothing is: a region that the end
        /// of the scan cuts off then ends there.
        shell_beyond: bool = true,
        /// What the fit is right for: "grid", the voxels, where splats are decoded and interpolated, as the
        /// CT itself is shown; or "field", the space between them too. "grid" takes no offsets, and becomes
        /// "field" with a working_grid above 1.
        form: FitForm = FitForm::Grid,
        /// Weight of the squared intensity error in the rim of one voxel around the ROI, for form "grid" and
        /// a binary mask: a sample between two voxels at the edge takes its intensity from there, too.
        rim_weight: f32 = 0.1,
        /// Sub-voxel target offsets of form "field", visited in turn: the grid itself and offsets - 1 random
        /// ones.
        offsets: usize = 16,
        /// Visits the grid itself every so many iterations besides its turn; 0: only in its turn.
        grid_every: u32 = 0,
        /// Epsilon of equation (2), in units of the summed weight.
        epsilon: f32 = 1e-3,
        /// First learning rate of the means, voxels; with scale_unit "box" parts of the volume's edges.
        rate_mean: f32 = 0.2,
        /// First learning rate of the rotations, radians.
        rate_rotation: f32 = 0.12,
        /// First learning rate of the logarithmic scales.
        rate_log_scale: f32 = 0.12,
        /// First learning rate of the opacity logits.
        rate_opacity: f32 = 0.2,
        /// First learning rate of the intensities, in spans of hu_range.
        rate_intensity: f32 = 0.02,
        /// Whether intensities are learned; otherwise they are those of the volume at the means.
        learn_intensity: bool = true,
        /// Whether opacities are learned; otherwise they are those of the mask, its mean within one standard
        /// deviation.
        learn_opacity: bool = true,
        /// Iterations between two samplings of intensities or opacities that are not learned; 0: only at the
        /// end, where they are always sampled.
        sample_every: u32 = 100,
        /// Whether intensities stay in the range of the ROI, which a transfer function per splat needs.
        clamp_intensity: bool = true,
        /// All rates fall exponentially to this share of their first value over the schedule.
        rate_decay: f32 = 0.02,
        /// The rate of the means falls besides, to this share ...
        rate_mean_decay: f32 = 1.0,
        /// ... over so many iterations, and on beyond them.
        rate_mean_decay_iterations: u32 = 20_000,
        /// Adam's decay of the first moment.
        beta1: f32 = 0.8,
        /// Adam's decay of the second moment; 0.9 is worth up to 3 dB over the usual 0.99.
        beta2: f32 = 0.9,
        /// Adam's epsilon.
        adam_epsilon: f32 = 1e-15,
        /// Smallest standard deviation of a splat, voxels; below 0.35 it can fall between all voxel centres.
        scale_min: f32 = 0.4,
        /// Largest standard deviation of a splat, voxels.
        scale_max: f32 = 10.0,
        /// No scale of a splat exceeds this times its first largest one; 0: no such limit.
        scale_growth: f32 = 0.0,
        /// Opacity logits stay within plus and minus this.
        logit_max: f32 = 9.0,
        /// Splats that one iteration updates, another random part of all each time; 0: all of them.
        subset: usize = 0,
        /// Whether an iteration rasterizes its subset alone, which saves memory; otherwise all splats are
        /// rasterized and the subset moves.
        subset_alone: bool = true,
        /// Whether Adam takes a step for all splats at each iteration, those outside of the subset with a
        /// gradient of 0, so that their momentum carries them on.
        subset_dense: bool = false,
        /// How the number and the places of the splats change on the way: "none", "densify" (the paper's
        /// clone, split, prune and hole filling), "growth" (new splats where the error is largest),
        /// "relocate" (idle splats move there) or "reference" (densify as the paper's authors' code has it).
        topology: String = "none".to_owned(),
        /// Topology: first iteration after which splats may change.
        topology_from: u32 = 100,
        /// Topology: last iteration after which splats may change.
        topology_until: u32 = 2000,
        /// Topology: iterations between two changes.
        topology_every: u32 = 100,
        /// Topology: the most splats that are added or moved at once, share of all.
        topology_share: f32 = 0.05,
        /// Topology: the number of splats never exceeds this times the first one.
        topology_limit: f32 = 1.0,
        /// Topology "densify": splats whose accumulated position gradient lies above this percentile are
        /// refined.
        topology_percentile: f32 = 60.0,
        /// Topology "densify": splats up to this largest scale are cloned, larger ones split, voxels.
        topology_split_scale: f32 = 2.75,
        /// Topology "densify": splats below this opacity are removed.
        topology_prune_opacity: f32 = 1e-4,
        /// Topology "densify": voxels of the ROI with a summed weight below this are holes.
        topology_hole_weight: f32 = 0.01,
        /// How samples are stored between the passes: "full" (32 bits a number) or "mixed" (16 bits).
        storage: Storage = Storage::Full,
    }
}

impl FitConfig {
    /// Refuses values that cannot work, naming the key.
    pub fn check(&self) -> Result<()> {
        let wrong = |key: &str, found: String, needed: &str| {
            Err(Error::new(Kind::Usage, "VGS-CFG-001", format!("{key} = {found}: {needed} is needed")))
        };
        if self.iterations == 0 || self.iterations > 10_000_000 {
            return wrong("iterations", self.iterations.to_string(), "1 to 10000000");
        }
        if !(self.density > 0.0 && self.density <= 100.0) && self.splats == 0 {
            return wrong("density", self.density.to_string(), "more than 0 and at most 100");
        }
        if self.offsets == 0 || self.offsets > 64 {
            return wrong("offsets", self.offsets.to_string(), "1 to 64");
        }
        if self.shell > 32 {
            return wrong("shell", self.shell.to_string(), "0 to 32 voxels");
        }
        let [low, high] = self.hu_range;
        if !(low.is_finite() && high.is_finite() && (low < high || self.hu_range == [0.0, 0.0])) {
            return wrong("hu_range", format!("{low},{high}"), "low,high with low < high");
        }
        let positive = [
            ("epsilon", self.epsilon),
            ("occupancy_w0", self.occupancy_w0),
            ("adam_epsilon", self.adam_epsilon),
            ("rate_decay", self.rate_decay),
            ("rate_mean_decay", self.rate_mean_decay),
            ("topology_split_scale", self.topology_split_scale),
            ("scale_min", self.scale_min),
            ("logit_max", self.logit_max),
        ];
        let not_negative = [
            ("mse_weight", self.mse_weight),
            ("mask_weight", self.mask_weight),
            ("leak_weight", self.leak_weight),
            ("occupancy_weight", self.occupancy_weight),
            ("hold_weight", self.hold_weight),
            ("init_footprint", self.init_footprint),
            ("dice_smoothing", self.dice_smoothing),
            ("rim_weight", self.rim_weight),
            ("target_psnr", self.target_psnr),
            ("target_hu", self.target_hu),
            ("scale_weight", self.scale_weight),
            ("scale_growth", self.scale_growth),
            ("topology_hole_weight", self.topology_hole_weight),
            ("rate_mean", self.rate_mean),
            ("rate_rotation", self.rate_rotation),
            ("rate_log_scale", self.rate_log_scale),
            ("rate_opacity", self.rate_opacity),
            ("rate_intensity", self.rate_intensity),
        ];
        for (key, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return wrong(key, value.to_string(), "a positive number");
            }
        }
        for (key, value) in not_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return wrong(key, value.to_string(), "a number of at least 0");
            }
        }
        for (key, value) in [("beta1", self.beta1), ("beta2", self.beta2)] {
            if !(0.0..1.0).contains(&value) {
                return wrong(key, value.to_string(), "at least 0 and less than 1");
            }
        }
        if !(self.scale_max >= self.scale_min && self.scale_max.is_finite()) {
            return wrong("scale_max", self.scale_max.to_string(), "at least scale_min");
        }
        for (key, value, least, most) in [
            ("working_grid", self.working_grid, 1, 16),
            ("rate_mean_decay_iterations", self.rate_mean_decay_iterations, 1, u32::MAX),
            ("topology_every", self.topology_every, 1, u32::MAX),
            ("leak_power", self.leak_power, 1, 2),
        ] {
            if !(least..=most).contains(&value) {
                return wrong(key, value.to_string(), &format!("{least} to {most}"));
            }
        }
        for (key, value, least, most) in [
            ("region_threshold", self.region_threshold, 0.0, 0.99),
            ("occupancy_tolerance", self.occupancy_tolerance, 0.0, 0.49),
            ("topology_share", self.topology_share, 0.0, 1.0),
            ("topology_limit", self.topology_limit, 1.0, 1000.0),
            ("topology_percentile", self.topology_percentile, 0.0, 100.0),
            ("topology_prune_opacity", self.topology_prune_opacity, 0.0, 1.0),
        ] {
            if !(least..=most).contains(&value) {
                return wrong(key, value.to_string(), &format!("{least} to {most}"));
            }
        }
        if self.has_goal() && self.working_grid > 1 {
            return wrong(
                "working_grid",
                self.working_grid.to_string(),
                "1 with a target, which counts voxels",
            );
        }
        if self.has_goal() && self.topology()?.change.is_some() {
            return wrong("topology", self.topology.clone(), "\"none\" with a target, which sets the number");
        }
        if self.has_goal() && self.rate_mean < LEAST_RATE_WITH_GOAL {
            let needed = format!("at least {LEAST_RATE_WITH_GOAL} with a target, whose trials are short");
            return wrong("rate_mean", self.rate_mean.to_string(), &needed);
        }
        self.mask_loss()?;
        self.intensity_loss()?;
        self.initialiser()?;
        self.orientation()?;
        self.topology()?;
        self.init().check()
    }

    /// Returns true if the number of splats follows from an error that is to be reached.
    pub fn has_goal(&self) -> bool {
        self.target_psnr > 0.0 || self.target_hu > 0.0
    }

    /// Returns the configuration without an error that is to be reached.
    pub fn without_goal(self) -> FitConfig {
        let FitConfig { target_psnr, target_hu, target_rounds, .. } = FitConfig::default();
        FitConfig { target_psnr, target_hu, target_rounds, ..self }
    }

    /// Returns the row of the table that `initialiser` names.
    pub fn initialiser(&self) -> Result<&'static Initialiser> {
        row("initialiser", &self.initialiser, INITIALISERS, |row| row.name)
    }

    /// Returns the row of the table that `init_orientation` names.
    pub fn orientation(&self) -> Result<&'static Orientation> {
        row("init_orientation", &self.init_orientation, ORIENTATIONS, |row| row.name)
    }

    /// Returns the hyper-parameters of the initialiser. An orientation of unknown name, which
    /// [`FitConfig::check`] refuses, counts as the default one.
    pub fn init(&self) -> InitConfig {
        InitConfig {
            gradient_exponent: self.init_gradient_exponent,
            gradient_floor: self.init_gradient_floor,
            smoothing_sigma: self.init_smoothing,
            anisotropy: self.init_anisotropy,
            scale_factor: self.init_scale,
            scale_min: self.init_scale_min,
            scale_max: self.init_scale_max,
            unit: self.scale_unit,
            orientation: self.orientation().unwrap_or(&ORIENTATIONS[0]),
            footprint: self.init_footprint,
            opacity: self.init_opacity,
            opacity_mask: self.init_opacity_mask,
            deadline: None,
        }
    }

    /// Returns the least and the greatest scale of a splat in the fit, voxels of `volume`.
    pub fn scale_clamp(&self, volume: &Volume) -> (f32, f32) {
        self.scale_unit.clamp(self.scale_min, self.scale_max, volume)
    }

    /// Returns where the field must match the volume: `form`, except that a working grid coarser than the
    /// volume's own needs [`FitForm::Field`], since its voxels are not those that are shown.
    pub fn effective_form(&self) -> FitForm {
        if self.working_grid > 1 { FitForm::Field } else { self.form }
    }

    /// Returns what lies between thick slices: `between_slices`, except that a working grid coarser than the volume's
    /// own has no more slices.
    pub fn effective_between_slices(&self) -> BetweenSlices {
        if self.working_grid > 1 { BetweenSlices::Linear } else { self.between_slices }
    }

    /// Returns the number of target grids that the fit visits in turn: `offsets`, or one for the form "grid".
    pub fn offset_count(&self) -> usize {
        if self.effective_form() == FitForm::Grid { 1 } else { self.offsets }
    }

    /// Returns the form of the fitted splats, for files and pictures.
    pub fn fitted_form(&self) -> splat::Form {
        match self.effective_form() {
            FitForm::Field => splat::Form::Field,
            FitForm::Grid => splat::Form::Grid,
        }
    }

    /// Returns true if the fit is shown as voxels that are wholly inside of `roi` or wholly outside.
    pub(super) fn is_classified(&self, roi: &Roi) -> bool {
        self.effective_form() == FitForm::Grid && !roi.soft && self.region_threshold == 0.0
    }

    /// Returns the weight of the occupancy error.
    pub(super) fn occupancy_weight(&self, roi: &Roi) -> f32 {
        if self.is_classified(roi) { self.hold_weight } else { self.occupancy_weight }
    }

    /// Returns true if the rim of `roi` has a weight of its own.
    pub(super) fn has_rim(&self, roi: &Roi) -> bool {
        self.is_classified(roi) && self.rim_weight > 0.0
    }

    /// Returns the number of splats for a region of interest of `roi_voxels` voxels; at least one.
    pub fn splat_count(&self, roi_voxels: f64) -> usize {
        let asked = if self.splats > 0 { self.splats } else { (roi_voxels * self.density).round() as usize };
        let most = if self.max_splats > 0 { self.max_splats } else { usize::MAX };
        asked.clamp(1, most)
    }

    /// Returns the most splats that a goal may take in a region of `roi_voxels` voxels.
    pub fn most_splats(&self, roi_voxels: f64) -> usize {
        if self.max_splats > 0 { self.max_splats } else { (roi_voxels.ceil() as usize).max(1) }
    }

    /// Returns the constants of the fitted field over `background`, the intensity where no splat reaches.
    pub fn field(&self, background: f32) -> splat::Field {
        splat::Field {
            kernel: self.kernel,
            background,
            epsilon: self.epsilon,
            occupancy_w0: self.occupancy_w0,
        }
    }
}

/// Returns the row of `table` called `name`; if there is none, fails with `key` and the list of names.
pub(super) fn row<T>(
    key: &str,
    name: &str,
    table: &'static [T],
    name_of: impl Fn(&T) -> &'static str,
) -> Result<&'static T> {
    table.iter().find(|row| name_of(row) == name).ok_or_else(|| {
        let names: Vec<_> = table.iter().map(name_of).collect();
        Error::new(
            Kind::Usage,
            "VGS-CFG-002",
            format!("{key} = {name:?}: one of {} is needed", names.join(", ")),
        )
    })
}
