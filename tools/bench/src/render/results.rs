//! What reports are made from.

use engine::gpu::DeviceDescription;

use super::config::{Config, Section};
use super::plan::{Plan, Unit};
use super::record::{Record, Records};

/// The device, as tables name it.
#[derive(Clone, Debug)]
pub struct Device {
    /// Name, kind and driver.
    pub text: String,
    /// Whether it is a driver that runs on the CPU.
    pub is_cpu: bool,
}

impl Device {
    /// As it describes itself.
    pub fn new(description: &DeviceDescription) -> Self {
        Device {
            text: format!("{} ({}, {})", description.name, description.kind, description.driver),
            is_cpu: description.kind == "CPU",
        }
    }

    /// What frames are compared by.
    pub fn unit(&self) -> &'static str {
        if self.is_cpu { "core-ms" } else { "device ms" }
    }
}

/// What reports are made from.
pub struct Results<'a> {
    /// The configuration.
    pub config: &'a Config,
    /// What was to be done.
    pub plan: &'a Plan,
    /// Sections that were asked for.
    pub sections: &'a [Section],
    /// What there is.
    pub records: &'a Records,
    /// Why there is no record, by key.
    pub skipped: &'a std::collections::BTreeMap<String, String>,
    /// Where it was measured.
    pub device: &'a Device,
    /// Whether it was a quick run.
    pub quick: bool,
    /// How to measure it again.
    pub command: &'a str,
}

impl Results<'_> {
    /// Units of a section, with their records.
    pub fn units(&self, section: Section) -> impl Iterator<Item = (&Unit, &Record)> {
        self.plan
            .units
            .iter()
            .filter(move |unit| unit.section == section)
            .filter_map(|unit| Some((unit, self.records.get(&unit.key())?)))
    }
}
