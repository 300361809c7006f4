//! Configuration file of `bench render`: cases, transfer functions, renderings, and what each section does
//! with them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use engine::fit::{FitConfig, Profile};
use engine::render::Classification;
use engine::transfer::preset;
use engine::{Error, Kind, Result};
use serde::{Deserialize, Serialize};

/// The configuration that is used unless `--config` names another.
pub const DEFAULT: &str = include_str!("default.toml");

/// Sections that `--only` can choose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Section {
    /// Splats, and the volume downsampled, against the volume
    EndToEnd,
    /// Modes against the exact one, and one order of the splats for two eyes
    RendererError,
    /// Packed splats against full ones
    Storage,
    /// Time and memory of a frame
    Speed,
    /// The paper's Table 5
    Table5,
}

impl Section {
    /// Returns the name that `--only` and the configuration use.
    pub fn name(self) -> &'static str {
        match self {
            Section::EndToEnd => "end-to-end",
            Section::RendererError => "renderer-error",
            Section::Storage => "storage",
            Section::Speed => "speed",
            Section::Table5 => "table5",
        }
    }

    /// Returns true if the section times frames rather than comparing pictures.
    pub fn is_timed(self) -> bool {
        matches!(self, Section::Speed | Section::Table5)
    }
}

/// Views around the region of interest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Orbit {
    /// Views, evenly spaced in azimuth; the first from the front.
    pub count: usize,
    /// Angle above the horizon in even views, below it in odd ones, degrees.
    pub elevation: f64,
    /// Field of view, degrees.
    pub fov: f64,
}

/// Volume with a region of interest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// Name in tables.
    pub name: String,
    /// Folder in the data folder.
    #[serde(default)]
    pub folder: String,
    /// Volume in the folder.
    #[serde(default = "Case::usual_volume")]
    pub volume: String,
    /// Mask in the folder.
    #[serde(default)]
    pub mask: String,
    /// Profile of the fit.
    #[serde(default = "Case::usual_profile")]
    pub profile: String,
    /// Edge of the synthetic CT that is used in place of files, voxels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phantom: Option<usize>,
}

impl Case {
    fn usual_volume() -> String {
        "ct.nii.gz".into()
    }

    fn usual_profile() -> String {
        "default".into()
    }

    /// Describes where the case comes from, for tables.
    pub fn source(&self) -> String {
        match self.phantom {
            Some(edge) => format!("phantom {edge}³"),
            None => format!("{} {}", self.folder, self.mask.trim_end_matches(".gz").trim_end_matches(".nii")),
        }
    }
}

/// Transfer function: a preset, or a narrow band.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Transfer {
    /// Name in tables.
    pub name: String,
    /// Name of a preset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// Width of an opaque band around the median intensity of the region, HU.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub band: Option<f64>,
    /// True if surfaces are lit; `None` leaves it to the preset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shade: Option<bool>,
}

/// Classification along a ray: where the transfer function is applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Classify {
    /// Classifies the samples (`Classification::Point`).
    Point,
    /// Integrates between the samples (`Classification::PreIntegrated`).
    Integrated,
}

impl From<Classify> for Classification {
    fn from(classify: Classify) -> Self {
        match classify {
            Classify::Point => Classification::Point,
            Classify::Integrated => Classification::PreIntegrated,
        }
    }
}

/// Render mode with its settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rendering {
    /// Name in tables.
    pub name: String,
    /// Name of a mode of the engine.
    pub mode: String,
    /// Sample distance (`Settings::step`), in standard deviations of a splat or shortest edges of a voxel.
    #[serde(default = "Rendering::usual_step")]
    pub step: f64,
    /// Classification; `None` leaves it to the look.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub classification: Option<Classify>,
    /// True if modes volume and decoded start their rays in a kernel (`Rays::Computed`).
    #[serde(default, skip_serializing_if = "is_false")]
    pub computed: bool,
}

impl Rendering {
    fn usual_step() -> f64 {
        1.0
    }
}

/// Case with splats.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Subject {
    /// Name of the case.
    pub case: String,
    /// Splats per voxel of the region.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Number of splats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splats: Option<usize>,
    /// File of splats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ply: Option<PathBuf>,
    /// Profile of the fit, in place of the case's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    /// Names of the renderings to measure, in place of the section's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub renderings: Option<Vec<String>>,
    /// True if the splats are rendered as standard 3DGS splats, with colours of their own in place of an
    /// intensity.
    #[serde(default, skip_serializing_if = "is_false")]
    pub coloured: bool,
}

/// Returns true if serde should leave the field out of the file.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
pub(super) fn is_false(value: &bool) -> bool {
    !value
}

/// Settings of one section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Edge of the square pictures, pixels.
    pub size: u32,
    /// Names of the transfer functions.
    pub transfers: Vec<String>,
    /// Names of the renderings to measure.
    pub renderings: Vec<String>,
    /// Cases with their splats.
    pub subjects: Vec<Subject>,
    /// Name of the rendering that pictures are compared with; for `end-to-end` and `renderer-error`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<String>,
    /// Factors by which the volume is downsampled; for `end-to-end`.
    #[serde(default)]
    pub downsampled: Vec<usize>,
    /// Names of the renderings that are also made for two eyes; for `renderer-error`.
    #[serde(default)]
    pub stereo: Vec<String>,
    /// Indices of the views in the orbit; all of them if empty.
    #[serde(default)]
    pub views: Vec<usize>,
    /// Timed frames of each rendering; for `speed` and `table5`.
    #[serde(default)]
    pub frames: usize,
    /// Warm-up frames from each view before the timed ones; for `speed` and `table5`.
    #[serde(default)]
    pub warm_up: usize,
    /// True if volumes are also rendered without their mask; for `speed`.
    #[serde(default)]
    pub whole: bool,
    /// Time limit of the whole section on a CPU driver, minutes; for `table5`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget_minutes: Option<f64>,
}

/// Goal for the rows that match its section and, if given, case, splats, transfer function and rendering.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// Section of the rows.
    pub section: Option<Section>,
    /// Case of the rows, if given.
    pub case: Option<String>,
    /// Number of splats of the rows, if given.
    pub splats: Option<usize>,
    /// Transfer function of the rows, if given.
    pub transfer: Option<String>,
    /// Rendering of the rows, if given.
    pub rendering: Option<String>,
    /// Least mean PSNR, dB.
    pub psnr: Option<f64>,
    /// Least mean SSIM.
    pub ssim: Option<f64>,
    /// Greatest distance below the PSNR of the rendering `of`, dB.
    pub within: Option<f64>,
    /// Name of the rendering that `within` refers to.
    pub of: Option<String>,
    /// Most CPU time per frame on a CPU driver, ms.
    pub core_ms: Option<f64>,
    /// Least factor by which the row must be cheaper than the volume with its mask.
    pub faster: Option<f64>,
    /// Source of the figure, or a figure from elsewhere.
    pub was: Option<String>,
}

/// Contents of the configuration file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Iterations of the fits, in place of those of their profiles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iterations: Option<u32>,
    /// Views.
    pub orbit: Orbit,
    /// Volumes.
    #[serde(rename = "case")]
    pub cases: Vec<Case>,
    /// Transfer functions.
    #[serde(rename = "transfer")]
    pub transfers: Vec<Transfer>,
    /// Renderings.
    #[serde(rename = "rendering")]
    pub renderings: Vec<Rendering>,
    /// Settings of each section.
    #[serde(rename = "section")]
    pub parts: BTreeMap<Section, Part>,
    /// Goals.
    #[serde(default, rename = "goal")]
    pub goals: Vec<Goal>,
}

/// Iterations of a fit in a quick run.
const QUICK_ITERATIONS: u32 = 60;
/// Most frames of a quick run.
const QUICK_FRAMES: usize = 2;

impl Config {
    /// Reads the configuration from `file`, or returns the default one.
    ///
    /// # Errors
    /// Returns [`Kind::Missing`] if the file is missing, [`Kind::Usage`] if its contents are wrong.
    pub fn read(file: Option<&Path>) -> Result<Self> {
        let Some(path) = file else { return Config::parse(DEFAULT) };
        let text =
            std::fs::read_to_string(path).map_err(|e| Error::io(path, "reading the configuration", &e))?;
        Config::parse(&text).map_err(|e| e.file(path))
    }

    /// Parses and checks a configuration (TOML).
    pub fn parse(text: &str) -> Result<Self> {
        let config: Config = toml::from_str(text).map_err(|e| {
            Error::new(Kind::Usage, "VGS-BEN-020", format!("not a configuration of bench render: {e}")).help(
                "tools/research/bench/src/render/default.toml is the one used without --config, and explains all keys",
            )
        })?;
        config.check()?;
        Ok(config)
    }

    /// Returns a copy with only the first subject of each section, half the size, two views, few frames and
    /// short fits.
    #[must_use]
    pub fn quick(&self) -> Self {
        let mut quick = self.clone();
        quick.iterations = Some(self.iterations.unwrap_or(QUICK_ITERATIONS).min(QUICK_ITERATIONS));
        for part in quick.parts.values_mut() {
            part.size = (part.size / 2).max(1);
            part.subjects.truncate(1);
            part.views = match part.views[..] {
                [] => (0..self.orbit.count).step_by(3).take(2).collect(),
                _ => part.views.iter().copied().take(2).collect(),
            };
            part.frames = part.frames.min(QUICK_FRAMES);
        }
        quick
    }

    /// Finds the case with this name.
    pub fn case(&self, name: &str) -> Result<&Case> {
        named(&self.cases, "case", name, |row| &row.name)
    }

    /// Returns the case of a subject, with the profile that it is fitted with.
    pub fn case_of(&self, subject: &Subject) -> Result<Case> {
        let case = self.case(&subject.case)?.clone();
        Ok(Case { profile: subject.profile.clone().unwrap_or(case.profile), ..case })
    }

    /// Finds the transfer function with this name.
    pub fn transfer(&self, name: &str) -> Result<&Transfer> {
        named(&self.transfers, "transfer", name, |row| &row.name)
    }

    /// Finds the rendering with this name.
    pub fn rendering(&self, name: &str) -> Result<&Rendering> {
        named(&self.renderings, "rendering", name, |row| &row.name)
    }

    /// Returns the configuration of the fit of a subject that is no file.
    pub fn fit(&self, subject: &Subject) -> Result<FitConfig> {
        let profile = Profile::named(&self.case_of(subject)?.profile)?.config()?;
        let config = profile.with(|c| {
            c.iterations = self.iterations.unwrap_or(c.iterations);
            c.count.splats = subject.splats.unwrap_or(0);
            c.count.density = subject.density.unwrap_or(c.count.density);
        });
        config.check()?;
        Ok(config)
    }

    fn check(&self) -> Result<()> {
        let orbit = self.orbit;
        require((1..=360).contains(&orbit.count), || {
            format!("orbit.count = {}: 1 to 360 views are needed", orbit.count)
        })?;
        require(orbit.elevation.abs() < 90.0, || {
            format!("orbit.elevation = {}: less than 90 is needed", orbit.elevation)
        })?;
        require((0.01..=170.0).contains(&orbit.fov), || {
            format!("orbit.fov = {}: 0.01 to 170 is needed", orbit.fov)
        })?;
        unique("case", self.cases.iter().map(|row| &row.name))?;
        unique("transfer", self.transfers.iter().map(|row| &row.name))?;
        unique("rendering", self.renderings.iter().map(|row| &row.name))?;
        for case in &self.cases {
            let files = !case.folder.is_empty() && !case.mask.is_empty();
            require(files != case.phantom.is_some(), || {
                format!("case {:?} needs a folder and a mask, or a phantom", case.name)
            })?;
            require(case.phantom.is_none_or(|edge| (8..=512).contains(&edge)), || {
                format!("case {:?}: a phantom has an edge of 8 to 512 voxels", case.name)
            })?;
            let profile = Profile::named(&case.profile)?.config()?;
            require(profile.samples.working_grid == 1, || {
                format!(
                    "case {:?}: profile {:?} fits on a coarser grid, which is not done here",
                    case.name, case.profile
                )
            })?;
        }
        for transfer in &self.transfers {
            require(transfer.preset.is_some() != transfer.band.is_some(), || {
                format!("transfer {:?} needs a preset or a band", transfer.name)
            })?;
            transfer.preset.as_deref().map(preset).transpose()?;
            require(transfer.band.is_none_or(|w| w > 0.0 && w < 1e6), || {
                format!("transfer {:?}: a band has a width above 0 HU", transfer.name)
            })?;
        }
        for rendering in &self.renderings {
            require((0.01..=100.0).contains(&rendering.step), || {
                format!("rendering {:?}: step = {}: 0.01 to 100 is needed", rendering.name, rendering.step)
            })?;
        }
        self.parts.iter().try_for_each(|(&section, part)| self.check_part(section, part))?;
        for goal in &self.goals {
            require(goal.section.is_some(), || "a goal needs a section".into())?;
            require(goal.within.is_some() == goal.of.is_some(), || {
                "a goal has within and of, or neither".into()
            })?;
        }
        Ok(())
    }

    fn check_part(&self, section: Section, part: &Part) -> Result<()> {
        let name = section.name();
        let wrong = |what: String| format!("section.{name}: {what}");
        require((8..=8192).contains(&part.size), || {
            wrong(format!("size = {}: 8 to 8192 pixels are needed", part.size))
        })?;
        let lists = [
            ("transfers", part.transfers.len()),
            ("renderings", part.renderings.len()),
            ("subjects", part.subjects.len()),
        ];
        for (what, count) in lists {
            require(count > 0, || wrong(format!("{what} is empty")))?;
        }
        part.transfers.iter().try_for_each(|name| self.transfer(name).map(drop))?;
        let renderings = part.renderings.iter().chain(&part.stereo).chain(&part.reference);
        renderings.into_iter().try_for_each(|name| self.rendering(name).map(drop))?;
        for subject in &part.subjects {
            subject.renderings.iter().flatten().try_for_each(|name| self.rendering(name).map(drop))?;
            let ways = [subject.density.is_some(), subject.splats.is_some(), subject.ply.is_some()];
            require(ways.iter().filter(|&&given| given).count() == 1, || {
                wrong(format!("a subject of case {:?} needs one of density, splats, ply", subject.case))
            })?;
            if subject.ply.is_none() {
                self.fit(subject)?;
            }
        }
        for &view in &part.views {
            require(view < self.orbit.count, || {
                wrong(format!("there is no view {view} of {}", self.orbit.count))
            })?;
        }
        for &factor in &part.downsampled {
            require((2..=16).contains(&factor), || {
                wrong(format!("downsampled by {factor}: 2 to 16 is needed"))
            })?;
        }
        require(part.budget_minutes.is_none_or(|m| m >= 0.0), || wrong("budget_minutes is negative".into()))?;
        let compares = matches!(section, Section::EndToEnd | Section::RendererError);
        let keys = [
            ("reference", part.reference.is_some(), compares, compares),
            ("downsampled", !part.downsampled.is_empty(), false, section == Section::EndToEnd),
            ("stereo", !part.stereo.is_empty(), false, section == Section::RendererError),
            ("frames", part.frames > 0, section.is_timed(), section.is_timed()),
            ("warm_up", part.warm_up > 0, section.is_timed(), section.is_timed()),
            ("whole", part.whole, false, section == Section::Speed),
            (
                "budget_minutes",
                part.budget_minutes.is_some(),
                section == Section::Table5,
                section == Section::Table5,
            ),
        ];
        for (key, given, needed, used) in keys {
            require(given || !needed, || wrong(format!("{key} is needed, and more than 0")))?;
            require(used || !given, || wrong(format!("{key} does nothing here")))?;
        }
        Ok(())
    }
}

fn require(holds: bool, message: impl FnOnce() -> String) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::new(Kind::Usage, "VGS-BEN-021", message())) }
}

fn named<'a, T>(rows: &'a [T], what: &str, name: &str, of: fn(&T) -> &String) -> Result<&'a T> {
    rows.iter().find(|row| of(row) == name).ok_or_else(|| {
        let names: Vec<_> = rows.iter().map(|row| of(row).as_str()).collect();
        Error::new(Kind::Usage, "VGS-BEN-022", format!("there is no [[{what}]] with the name {name:?}"))
            .help(format!("there are {}", names.join(", ")))
    })
}

fn unique<'a>(what: &str, names: impl Iterator<Item = &'a String>) -> Result<()> {
    let mut seen = BTreeSet::new();
    for name in names {
        require(!name.is_empty() && seen.insert(name), || {
            format!("[[{what}]]: the name {name:?} is empty or there twice")
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_a_configuration_that_says_all() {
        let config = Config::read(None).expect("the default");
        assert_eq!(config.parts.keys().copied().collect::<Vec<_>>(), Section::value_variants());
        for section in Section::value_variants() {
            let value = section.to_possible_value().expect("a name");
            assert_eq!(value.get_name(), section.name());
        }
        // Goals name rows that there are.
        for goal in &config.goals {
            let section = goal.section.expect("a section");
            let part = &config.parts[&section];
            let known = |name: &Option<String>, mut names: Vec<String>| {
                names.extend(part.stereo.iter().map(|name| format!("{name}, one order for two eyes")));
                names.extend(part.downsampled.iter().map(|factor| format!("volume ÷{factor}")));
                names.extend(
                    part.renderings.iter().filter(|_| part.whole).map(|name| format!("{name}, whole CT")),
                );
                assert!(name.as_ref().is_none_or(|name| names.contains(name)), "{goal:?}");
            };
            known(&goal.case, part.subjects.iter().map(|s| s.case.clone()).collect());
            known(&goal.transfer, part.transfers.clone());
            let own = part.subjects.iter().filter_map(|s| s.renderings.clone()).flatten();
            let renderings: Vec<String> = part.renderings.iter().cloned().chain(own).collect();
            known(&goal.rendering, renderings.clone());
            known(&goal.of, renderings);
        }
    }

    #[test]
    fn a_quick_run_has_less_of_everything() {
        let config = Config::read(None).expect("the default");
        let quick = config.quick();
        quick.check().expect("it can be run");
        assert_eq!(quick.iterations, Some(QUICK_ITERATIONS));
        for (section, part) in &quick.parts {
            assert_eq!(part.subjects.len(), 1, "{section:?}");
            assert_eq!((part.size * 2, part.views.len()), (config.parts[section].size, 2), "{section:?}");
            assert_eq!(part.frames > 0, section.is_timed());
        }
        let subject = &quick.parts[&Section::EndToEnd].subjects[0];
        let fit = quick.fit(subject).expect("a fit");
        assert_eq!((fit.iterations, fit.count.density, fit.count.splats), (QUICK_ITERATIONS, 0.1, 0));
    }

    /// A change of the default, and what the message must name.
    #[test]
    fn what_cannot_work_is_refused_by_name() {
        for (from, to, says) in [
            ("count = 8", "count = 0", "orbit.count"),
            ("count = 8", "cuont = 8", "cuont"),
            ("fov = 30.0", "fov = 180.0", "orbit.fov"),
            ("elevation = 15.0", "elevation = 90.0", "orbit.elevation"),
            ("name = \"skull\"\nfolder = \"ct-skull\"", "name = \"skull\"", "\"skull\" needs a folder"),
            ("name = \"heart\"", "name = \"skull\"", "there twice"),
            ("name = \"heart\"", "name = \"heart\"\nprofile = \"best\"", "no profile \"best\""),
            ("preset = \"CT-Skin\"", "preset = \"CT-Skni\"", "CT-Skni"),
            ("preset = \"CT-Skin\"", "", "\"skin\" needs a preset or a band"),
            ("band = 60.0", "band = 0.0", "width above 0"),
            ("step = 0.05", "step = 0.0", "step = 0"),
            ("classification = \"point\"", "classification = \"linear\"", "linear"),
            ("size = 1024", "size = 4", "size = 4"),
            ("transfers = [\"steep bone\"]", "transfers = []", "transfers is empty"),
            (
                "transfers = [\"steep bone\"]",
                "transfers = [\"bone\"]",
                "no [[transfer]] with the name \"bone\"",
            ),
            ("reference = \"exact\"", "reference = \"exakt\"", "exakt"),
            ("reference = \"exact\"", "", "section.renderer-error: reference is needed"),
            ("density = 0.05", "density = 0.05, splats = 3", "one of density, splats, ply"),
            ("density = 0.05", "density = 0.0", "density = 0"),
            ("case = \"skull\", density", "case = \"skul\", density", "\"skul\""),
            ("views = [0, 3, 4, 7]", "views = [8]", "no view 8"),
            ("downsampled = [2, 4]", "downsampled = [1]", "downsampled by 1"),
            ("frames = 12", "frames = 0", "section.speed: frames is needed"),
            ("stereo = [\"alpha\", \"slab\"]", "frames = 3", "frames does nothing here"),
            ("budget_minutes = 40.0", "budget_minutes = -1.0", "budget_minutes"),
            ("section = \"storage\"\n", "", "a goal needs a section"),
            ("of = \"exact\"\n", "", "within and of"),
            ("[section.storage]", "[section.store]", "store"),
        ] {
            assert!(DEFAULT.contains(from), "{from}");
            let error = Config::parse(&DEFAULT.replacen(from, to, 1)).expect_err(says);
            assert_eq!(error.kind, Kind::Usage, "{error}");
            assert!(error.message.contains(says), "{says}: {error}");
        }
        let missing = Config::read(Some(Path::new("/nowhere/at-all.toml"))).expect_err("no file");
        assert!(missing.kind == Kind::Missing && missing.file.is_some());
    }
}
