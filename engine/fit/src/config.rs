//! Every hyper-parameter of a fit, by subject. Each is one documented line, which gives its key in a configuration
//! file, its flag on a command line and its field (`rate_mean`, `--rate-mean`, `rates.mean`).

use serde::{Deserialize, Serialize};

use super::declare::{Checked, config, wrong};
use super::unit::ScaleUnit;
use base::error::{Error, Kind, Result};
pub use passes::Storage;
use splat::Kernel;
use splat::activation::{OPACITY_MAX, OPACITY_MIN};
use volume::{BetweenSlices, Roi, Volume};

/// A value of [`FitConfig`] as programs show it.
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

config! {
    /// Hyper-parameters of a fit; the default is the profile `default` of `docs/design/method.md`.
    pub struct FitConfig {
        /// Iterations of the optimiser.
        iterations: u32 = 300, within(1, 10_000_000);
        pub struct Count as count {
            //! How many splats there are, or what error tells it.

            /// Splats per ROI voxel, when their number is not given.
            density: f64 = 0.1;
            /// Number of splats; 0 takes it from the density.
            splats: usize = 0;
            /// PSNR at the voxels of the region that is to be reached, dB: the number of splats is then what that
            /// takes; 0: no such goal.
            target_psnr: f32 = 0.0, at_least(0.0);
            /// Error that 99 % of the voxels of the region are to stay within, HU: the number of splats is then what
            /// that takes; 0: no such goal.
            target_hu: f32 = 0.0, at_least(0.0);
            /// Most times that splats are added where a finished fit misses its goal; 0: the number that short
            /// trials have found is final.
            target_rounds: u32 = 5;
            /// The most splats, whatever else says how many; 0: no limit but one for each voxel with a target.
            max_splats => max: usize = 0;
        }
        /// Seed of everything random; the same seed gives the same bits on the same device.
        seed: u64 = 0;
        pub struct Samples as samples {
            //! Where the field is held against the volume.

            /// Fits to volume and mask averaged over blocks of this many voxels along each axis; 1: to the voxels
            /// themselves.
            working_grid: u32 = 1, within(1, 16);
            /// What lies between slices that are much thicker than their pixels: "smooth", other slices, intensities by
            /// a cubic and masks by their shape, on whose finer grid the splats are fitted; or "linear", nothing.
            between_slices: BetweenSlices = BetweenSlices::Smooth;
            /// What the fit is right for: "grid", the voxels, where splats are decoded and interpolated, as the
            /// CT itself is shown; or "field", the space between them too. "grid" takes no offsets, and becomes
            /// "field" with a working_grid above 1.
            form: FitForm = FitForm::Grid;
            /// Sub-voxel target offsets of form "field", visited in turn: the grid itself and offsets - 1 random
            /// ones.
            offsets: usize = 16, within(1, 64);
            /// Visits the grid itself every so many iterations besides its turn; 0: only in its turn.
            grid_every: u32 = 0;
        }
        /// Splat kernel: "compact" (1-q/6)^3, "gaussian" exp(-q/2) for ordinary viewers, or "density", the
        /// Gaussian of unit integral.
        kernel: Kernel = Kernel::Compact;
        pub struct Init as init {
            //! The first splats. Scales count in `unit`; those of "gradient" follow from distances in voxels and stay
            //! in voxels.

            /// How splats are placed first: "gradient" (blue noise, denser where the intensity changes) or
            /// "uniform" (at random, the mask being the probability, with random scales).
            initialiser: String = "gradient".to_owned();
            /// Initialiser: exponent of the gradient in the density; 0 is an even density.
            init_gradient_exponent => gradient_exponent: f32 = 0.7, initial(0.0, 4.0);
            /// Initialiser: added to the gradient, in units of its mean, so that even regions get splats too.
            init_gradient_floor => gradient_floor: f32 = 0.1, initial(0.0, 1e3);
            /// Initialiser: standard deviation of the smoothing before and after the gradient, voxels.
            init_smoothing => smoothing_sigma: f32 = 0.8, initial(0.0, 8.0);
            /// Initialiser: what turns the splats: "gradient" (thin across an edge), "structure-tensor",
            /// "hessian" (long along a vessel) or "none".
            init_orientation => orientation: String = "gradient".to_owned();
            /// Initialiser: scale across the gradient over scale along it is this to the power 3/2.
            init_anisotropy => anisotropy: f32 = 1.5, initial(1.0, 100.0);
            /// Initialiser: scale over the mean distance of the four nearest neighbours.
            init_scale => scale_factor: f32 = 0.6, initial(0.01, 10.0);
            /// Initialiser: least scale before it is flattened, voxels; "uniform" draws all scales from this one
            /// ...
            init_scale_min => scale_min: f32 = 0.45, initial(0.01, 100.0);
            /// Initialiser: ... to the greatest.
            init_scale_max => scale_max: f32 = 8.0;
            /// Initialiser: opacity of every splat, 0 to 1.
            init_opacity => opacity: f32 = 0.5, initial(OPACITY_MIN, OPACITY_MAX);
            /// Initialiser: opacity of every splat is the mask at its centre instead.
            init_opacity_mask => opacity_mask: bool = false;
            /// Initialiser: from this scale on (geometric mean, voxels) a splat takes the mean intensity of the
            /// voxels within one standard deviation; 0: every splat takes that of its centre.
            init_footprint => footprint: f32 = 0.0, at_least(0.0), initial(0.0, 1e3);
            /// What the initial scales and the clamps of the scales count in: "voxel"; "spacing", the mean voxel
            /// spacing; or "box", where splats are shaped in the unit cube that the volume's box becomes
            /// (rate_mean counts in it, too).
            scale_unit => unit: ScaleUnit = ScaleUnit::Voxel;
        }
        pub struct Region as region {
            //! The region, and the intensities that count in it.

            /// Intensities are clipped to this range (HU); the span is the unit of the loss. [0, 0] leaves it to
            /// `range`.
            hu_range: [f32; 2] = [0.0, 0.0], rising();
            /// What hu_range [0, 0] stands for: "auto" (-1024..3071 for a CT, whose minimum is below -200, and
            /// the range of the volume otherwise) or "roi" (that of the region, which the figures at the end then
            /// count in, too).
            range: IntensityRange = IntensityRange::Auto;
            /// Which voxels are the region: 0: the mask weighs them (a binary one above one half); above 0: those
            /// whose mask is above this, all alike, and Dice and its kin look at no others.
            region_threshold => threshold: f32 = 0.0, within(0.0, 0.99);
            /// What stands where no splat reaches: the "mean" of the ROI, or "low", the lower end of hu_range.
            background: Background = Background::Mean;
        }
        pub struct Loss as loss {
            //! What the fit makes small.

            /// Weight of the intensity error inside the ROI.
            mse_weight: f32 = 1.0, at_least(0.0);
            /// The intensity error: "mse", or "dice", "tversky", "kl" between intensities in 0..1.
            intensity_loss => intensity: String = "mse".to_owned();
            /// Weight of the loss between 1 - exp(-W) and the mask over ROI and shell; 0 switches the term off.
            mask_weight: f32 = 0.0, at_least(0.0);
            /// The loss of the mask: "dice", "mse", "tversky" or "kl".
            mask_loss => mask: String = "dice".to_owned();
            /// Added to both sums of Dice, and twice that to those of Tversky, so that nothing is divided by
            /// nothing.
            dice_smoothing: f32 = 0.0, at_least(0.0);
            /// Weight of the mean of 1 - exp(-W) outside the ROI, in the shell; 0 switches the term off.
            leak_weight: f32 = 0.0, at_least(0.0);
            /// Power of 1 - exp(-W) in that mean, 1 or 2.
            leak_power: u32 = 1, within(1, 2);
            /// Whether that mean is over all voxels of the volume outside the ROI. The shell must hold whatever a
            /// splat reaches.
            leak_volume: bool = false;
            /// Weight of the mean length of a splat's three scales, in scale_unit (in edges of the cube where
            /// that is "box"), beside the mean intensity error; 0 switches the term off.
            scale_weight: f32 = 0.0, at_least(0.0);
            /// Weight of the occupancy error over ROI and shell, for form "field" or a soft mask; 0 switches the term
            /// off.
            occupancy_weight: f32 = 0.004, at_least(0.0);
            /// The same for form "grid" and a binary mask, over ROI and a shell of one voxel: the file has the region
            /// exactly, and this only keeps splats from reaching far beyond it, for modes and programs that draw
            /// them as they are.
            hold_weight: f32 = 0.0001, at_least(0.0);
            /// w0 of the occupancy O = W / (W + w0), in units of the summed weight W.
            occupancy_w0: f32 = 0.05, positive();
            /// An occupancy error up to this costs nothing, for form "grid" and a binary mask, 0 to 0.49.
            occupancy_tolerance: f32 = 0.4, within(0.0, 0.49);
            /// Thickness of the shell around the ROI that occupancy, Dice and leak look at, voxels along each
            /// axis.
            shell: u32 = 4, voxels(0, 32);
            /// Whether the shell goes on beyond the faces of the volume, where nothing is: a region that the end
            /// of the scan cuts off then ends there.
            shell_beyond: bool = true;
            /// Weight of the squared intensity error in the rim of one voxel around the ROI, for form "grid" and
            /// a binary mask and intensity_loss "mse": a sample between two voxels at the edge takes its intensity
            /// from there, too.
            rim_weight: f32 = 0.1, at_least(0.0);
        }
        /// Epsilon of equation (2), in units of the summed weight.
        epsilon: f32 = 1e-3, positive();
        pub struct Rates as rates {
            //! What is learned, and how fast.

            /// First learning rate of the means, voxels; with scale_unit "box" parts of the volume's edges.
            rate_mean => mean: f32 = 0.2, at_least(0.0);
            /// First learning rate of the rotations, radians.
            rate_rotation => rotation: f32 = 0.12, at_least(0.0);
            /// First learning rate of the logarithmic scales.
            rate_log_scale => log_scale: f32 = 0.12, at_least(0.0);
            /// First learning rate of the opacity logits.
            rate_opacity => opacity: f32 = 0.2, at_least(0.0);
            /// First learning rate of the intensities, in spans of hu_range.
            rate_intensity => intensity: f32 = 0.02, at_least(0.0);
            /// Whether intensities are learned; otherwise they are those of the volume at the means.
            learn_intensity: bool = true;
            /// Whether opacities are learned; otherwise they are those of the mask, its mean within one standard
            /// deviation.
            learn_opacity: bool = true;
            /// Iterations between two samplings of intensities or opacities that are not learned; 0: only at the
            /// end, where they are always sampled.
            sample_every: u32 = 100;
            /// Whether intensities stay in the range of the ROI, which a transfer function per splat needs.
            clamp_intensity: bool = true;
            /// All rates fall exponentially to this share of their first value over the schedule.
            rate_decay => decay: f32 = 0.02, positive();
            /// The rate of the means falls besides, to this share ...
            rate_mean_decay => mean_decay: f32 = 1.0, positive();
            /// ... over so many iterations, and on beyond them.
            rate_mean_decay_iterations => mean_decay_iterations: u32 = 20_000, within(1, u32::MAX);
        }
        pub struct Adam as adam {
            //! The constants of the optimiser.

            /// Adam's decay of the first moment.
            beta1: f32 = 0.8, below_one();
            /// Adam's decay of the second moment; 0.9 is worth up to 3 dB over the usual 0.99.
            beta2: f32 = 0.9, below_one();
            /// Adam's epsilon.
            adam_epsilon => epsilon: f32 = 1e-15, positive();
        }
        pub struct Scales as scales {
            //! What scales are clamped to, in the unit of those of [`Init`].

            /// Smallest standard deviation of a splat, voxels; below 0.35 it can fall between all voxel centres.
            scale_min => min: f32 = 0.4, positive();
            /// Largest standard deviation of a splat, voxels.
            scale_max => max: f32 = 10.0;
            /// No scale of a splat exceeds this times its first largest one; 0: no such limit.
            scale_growth => growth: f32 = 0.0, at_least(0.0);
        }
        /// Opacity logits stay within plus and minus this.
        logit_max: f32 = 9.0, positive();
        pub struct Subset as subset {
            //! How many splats move at once.

            /// Splats that one iteration updates, another random part of all each time; 0: all of them.
            subset => size: usize = 0;
            /// Whether an iteration rasterizes its subset alone, which saves memory; otherwise all splats are
            /// rasterized and the subset moves.
            subset_alone => alone: bool = true;
            /// Whether Adam takes a step for all splats at each iteration, those outside of the subset with a
            /// gradient of 0, so that their momentum carries them on.
            subset_dense => dense: bool = false;
        }
        pub struct Topology as topology {
            //! How the number and the places of the splats change on the way.

            /// How the number and the places of the splats change on the way: "none", "densify" (the paper's
            /// clone, split, prune and hole filling), "growth" (new splats where the error is largest),
            /// "relocate" (idle splats move there) or "reference" (densify as the paper's authors' code has it).
            topology => name: String = "none".to_owned();
            /// Topology: first iteration after which splats may change.
            topology_from => from: u32 = 100;
            /// Topology: last iteration after which splats may change.
            topology_until => until: u32 = 2000;
            /// Topology: iterations between two changes.
            topology_every => every: u32 = 100, within(1, u32::MAX);
            /// Topology: the most splats that are added or moved at once, share of all.
            topology_share => share: f32 = 0.05, within(0.0, 1.0);
            /// Topology: the number of splats never exceeds this times the first one.
            topology_limit => limit: f32 = 1.0, within(1.0, 1000.0);
            /// Topology "densify": splats whose accumulated position gradient lies above this percentile are
            /// refined.
            topology_percentile => percentile: f32 = 60.0, within(0.0, 100.0);
            /// Topology "densify": splats up to this largest scale are cloned, larger ones split, voxels.
            topology_split_scale => split_scale: f32 = 2.75, positive();
            /// Topology "densify": splats below this opacity are removed.
            topology_prune_opacity => prune_opacity: f32 = 1e-4, within(0.0, 1.0);
            /// Topology "densify": voxels of the ROI with a summed weight below this are holes.
            topology_hole_weight => hole_weight: f32 = 0.01, at_least(0.0);
        }
        /// How samples are stored between the passes: "full" (32 bits a number) or "mixed" (16 bits).
        storage: Storage = Storage::Full;
    }
}

impl FitConfig {
    /// Refuses values that cannot work, naming the key.
    pub fn check(&self) -> Result<()> {
        self.check_each()?;
        let FitConfig { count, init, scales, .. } = self;
        if !(count.density > 0.0 && count.density <= 100.0) && count.splats == 0 {
            return Err(wrong("density", count.density, "more than 0 and at most 100"));
        }
        if !(scales.max >= scales.min && scales.max.is_finite()) {
            return Err(wrong("scale_max", scales.max, "at least scale_min"));
        }
        Checked { key: "init_scale_max", name: "scale_max", value: &init.scale_max }
            .initial(init.scale_min, 1e3)?;
        if self.has_goal() && self.samples.working_grid > 1 {
            let needed = "1 with a target, which counts voxels";
            return Err(wrong("working_grid", self.samples.working_grid, needed));
        }
        if self.has_goal() && self.topology()?.change.is_some() {
            let needed = "\"none\" with a target, which sets the number";
            return Err(wrong("topology", &self.topology.name, needed));
        }
        if self.has_goal() && self.rates.mean < LEAST_RATE_WITH_GOAL {
            let needed = format!("at least {LEAST_RATE_WITH_GOAL} with a target, whose trials are short");
            return Err(wrong("rate_mean", self.rates.mean, &needed));
        }
        self.mask_loss()?;
        self.intensity_loss()?;
        init.initialiser()?;
        init.orientation()?;
        self.topology().map(|_| ())
    }

    /// Returns the configuration as `change` leaves it.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut FitConfig)) -> FitConfig {
        change(&mut self);
        self
    }

    /// Returns true if the number of splats follows from an error that is to be reached.
    pub fn has_goal(&self) -> bool {
        self.count.target_psnr > 0.0 || self.count.target_hu > 0.0
    }

    /// Returns the configuration without an error that is to be reached.
    #[must_use]
    pub fn without_goal(self) -> FitConfig {
        let Count { target_psnr, target_hu, target_rounds, .. } = Count::default();
        self.with(|c| c.count = Count { target_psnr, target_hu, target_rounds, ..c.count })
    }

    /// Returns the least and the greatest scale of a splat in the fit, voxels of `volume`.
    pub fn scale_clamp(&self, volume: &Volume) -> (f32, f32) {
        self.init.unit.clamp(self.scales.min, self.scales.max, volume)
    }

    /// Returns where the field must match the volume: `form`, except that a working grid coarser than the
    /// volume's own needs [`FitForm::Field`], since its voxels are not those that are shown.
    pub fn effective_form(&self) -> FitForm {
        if self.samples.working_grid > 1 { FitForm::Field } else { self.samples.form }
    }

    /// Returns what lies between thick slices: `between_slices`, except that a working grid coarser than the volume's
    /// own has no more slices.
    pub fn effective_between_slices(&self) -> BetweenSlices {
        if self.samples.working_grid > 1 { BetweenSlices::Linear } else { self.samples.between_slices }
    }

    /// Returns the number of target grids that the fit visits in turn: `offsets`, or one for the form "grid".
    pub fn offset_count(&self) -> usize {
        if self.effective_form() == FitForm::Grid { 1 } else { self.samples.offsets }
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
        self.effective_form() == FitForm::Grid && !roi.soft && self.region.threshold == 0.0
    }

    /// Returns the weight of the occupancy error.
    pub(super) fn occupancy_weight(&self, roi: &Roi) -> f32 {
        if self.is_classified(roi) { self.loss.hold_weight } else { self.loss.occupancy_weight }
    }

    /// Returns true if the rim of `roi` has a weight of its own.
    pub(super) fn has_rim(&self, roi: &Roi) -> bool {
        self.is_classified(roi) && self.loss.rim_weight > 0.0
    }

    /// Returns the number of splats for a region of interest of `roi_voxels` voxels; at least one.
    pub fn splat_count(&self, roi_voxels: f64) -> usize {
        let Count { splats, density, max, .. } = self.count;
        let asked = if splats > 0 { splats } else { (roi_voxels * density).round() as usize };
        let most = if max > 0 { max } else { usize::MAX };
        asked.clamp(1, most)
    }

    /// Returns the most splats that a goal may take in a region of `roi_voxels` voxels.
    pub fn most_splats(&self, roi_voxels: f64) -> usize {
        if self.count.max > 0 { self.count.max } else { (roi_voxels.ceil() as usize).max(1) }
    }

    /// Returns the constants of the fitted field over `background`, the intensity where no splat reaches.
    pub fn field(&self, background: f32) -> splat::Field {
        splat::Field {
            kernel: self.kernel,
            background,
            epsilon: self.epsilon,
            occupancy_w0: self.loss.occupancy_w0,
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

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    #[test]
    fn every_key_of_a_file_is_a_value_of_its_own() {
        let usual = serde_json::to_value(FitConfig::default()).unwrap();
        assert_eq!(usual.as_object().unwrap().len(), FitConfig::FIELDS.len());
        for Parameter { key, .. } in FitConfig::FIELDS {
            let mut changed = usual.clone();
            changed[key] = match &usual[key] {
                Value::Number(n) if n.is_u64() => json!(7),
                Value::Number(_) => json!(0.375),
                Value::Bool(yes) => json!(!yes),
                Value::Array(_) => json!([-1.0, 1.0]),
                // Of the names only some are free.
                name => name.clone(),
            };
            let config: FitConfig = serde_json::from_value(changed.clone()).unwrap();
            assert_eq!(serde_json::to_value(&config).unwrap(), changed, "{key}");
            let alone: FitConfig = serde_json::from_value(json!({ *key: changed[key] })).unwrap();
            assert_eq!(alone, config, "{key}");
        }
        assert!(serde_json::from_value::<FitConfig>(json!({ "init": {} })).is_err(), "groups are no keys");
    }

    #[test]
    fn no_number_may_be_nan_or_infinite() {
        let usual = serde_json::to_value(FitConfig::default()).unwrap();
        for Parameter { key, .. } in FitConfig::FIELDS.iter().filter(|field| usual[field.key].is_f64()) {
            for value in ["nan", "inf", "-inf"] {
                let config: FitConfig = toml::from_str(&format!("{key} = {value}")).unwrap();
                let error = config.check().expect_err(key);
                assert!(["VGS-CFG-001", "VGS-INIT-001"].contains(&error.code), "{key} = {value}: {error}");
            }
        }
    }
}
