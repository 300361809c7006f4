//! Plans the measurements, a unit at a time: a subject of a section with all that its figures depend on. Its
//! key names the file of its record.

use std::path::Path;

use engine::fit::FitConfig;
use engine::render::{MODES, ModeRow};
use engine::{Error, Result};
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::config::{Case, Config, Orbit, Part, Rendering, Section, Subject, Transfer, is_false};
use crate::store::hash;

/// Source of the splats of a unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Source {
    /// The splats are fitted.
    Fit(Box<FitConfig>),
    /// The splats are read from a file; the hash is that of its contents.
    File(std::path::PathBuf, String),
}

/// One subject of a section. Two units with the same fields give the same pictures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unit {
    /// Section.
    pub section: Section,
    /// Volume and region.
    pub case: Case,
    /// Source of the splats.
    pub source: Source,
    /// True if the splats get colours in place of intensities.
    #[serde(skip_serializing_if = "is_false")]
    pub coloured: bool,
    /// Transfer functions.
    pub transfers: Vec<Transfer>,
    /// Renderings to measure.
    pub renderings: Vec<Rendering>,
    /// Rendering that pictures are compared with, if there is one for all.
    pub reference: Option<Rendering>,
    /// Renderings for two eyes.
    pub stereo: Vec<Rendering>,
    /// Settings of the section. The names in it are resolved in the other fields, without those that cannot
    /// be measured.
    pub part: Part,
    /// All views.
    pub orbit: Orbit,
    /// Device and driver.
    pub device: String,
}

impl Unit {
    /// Returns the name of the record's file without its extension: a readable part, then a hash of all
    /// fields.
    pub fn key(&self) -> String {
        let subject = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
        let case: String = self.case.name.chars().map(subject).collect();
        format!("{}-{case}-{}-{}", self.section.name(), self.amount().replace(' ', "-"), hash(self))
    }

    /// Describes the number of splats as the configuration gives it.
    pub fn amount(&self) -> String {
        let amount = match &self.source {
            Source::File(..) => "file".into(),
            Source::Fit(config) if config.count.splats > 0 => config.count.splats.to_string(),
            Source::Fit(config) => format!("{} a voxel", config.count.density),
        };
        if self.coloured { amount + " coloured" } else { amount }
    }

    /// Returns a title for people.
    pub fn title(&self) -> String {
        format!(
            "{}: {}, splats: {}, {size}×{size}",
            self.section.name(),
            self.case.name,
            self.amount(),
            size = self.part.size
        )
    }

    /// Returns the indices of the views in the orbit.
    pub fn views(&self) -> Vec<usize> {
        if self.part.views.is_empty() { (0..self.orbit.count).collect() } else { self.part.views.clone() }
    }
}

/// All units of the sections, and notes on what cannot be measured.
pub struct Plan {
    /// Units in the order of the sections and of their subjects.
    pub units: Vec<Unit>,
    /// Lines that say what is left out and why.
    pub left_out: Vec<String>,
}

impl Plan {
    /// Plans the units of a configuration that was checked.
    pub fn new(config: &Config, sections: &[Section], device: &str) -> Result<Self> {
        let mut plan = Plan { units: Vec::new(), left_out: Vec::new() };
        for (&section, part) in config.parts.iter().filter(|(section, _)| sections.contains(section)) {
            let there = |name: &String| -> Result<Option<Rendering>> {
                let rendering = config.rendering(name)?;
                Ok(mode_row(rendering).map(|_| rendering.clone()))
            };
            let mut all = |names: &[String]| -> Result<Vec<Rendering>> {
                let mut list = Vec::new();
                for name in names {
                    match there(name)? {
                        Some(rendering) => list.push(rendering),
                        None => plan.left_out.push(missing(section, config.rendering(name)?)),
                    }
                }
                Ok(list)
            };
            let stereo = all(&part.stereo)?;
            let mut renderings = Vec::new();
            for subject in &part.subjects {
                renderings.push(all(subject.renderings.as_ref().unwrap_or(&part.renderings))?);
            }
            let reference = part.reference.as_ref().map(&there).transpose()?.flatten();
            if let (Some(name), None) = (&part.reference, &reference) {
                plan.left_out.push(format!("{}, all of it", missing(section, config.rendering(name)?)));
                continue;
            }
            let transfers = part
                .transfers
                .iter()
                .map(|name| config.transfer(name).cloned())
                .collect::<Result<Vec<_>>>()?;
            for (subject, renderings) in part.subjects.iter().zip(renderings) {
                plan.units.push(Unit {
                    section,
                    case: config.case_of(subject)?,
                    source: source(config, subject)?,
                    coloured: subject.coloured,
                    transfers: transfers.clone(),
                    renderings,
                    reference: reference.clone(),
                    stereo: stereo.clone(),
                    part: Part { subjects: Vec::new(), budget_minutes: None, ..part.clone() },
                    orbit: config.orbit,
                    device: device.to_owned(),
                });
            }
        }
        plan.left_out.dedup();
        Ok(plan)
    }
}

/// Finds the mode of a rendering; `None` if this build does not have it.
pub fn mode_row(rendering: &Rendering) -> Option<&'static ModeRow> {
    MODES.iter().find(|row| row.name == rendering.mode)
}

fn missing(section: Section, rendering: &Rendering) -> String {
    format!("{}: {} is left out: this build has no mode {:?}", section.name(), rendering.name, rendering.mode)
}

fn source(config: &Config, subject: &Subject) -> Result<Source> {
    let Some(path) = &subject.ply else { return Ok(Source::Fit(Box::new(config.fit(subject)?))) };
    Ok(Source::File(path.clone(), file_hash(path)?))
}

fn file_hash(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "reading splats", &e))?;
    Ok(Sha256::digest(bytes).iter().take(5).map(|b| format!("{b:02x}")).collect())
}
