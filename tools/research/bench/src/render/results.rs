//! Input of all reports.

use engine::gpu::DeviceDescription;

use super::config::{Config, Section};
use super::plan::{Plan, Unit};
use super::record::{Record, Records};

/// Device, as tables name it.
#[derive(Clone, Debug)]
pub struct Device {
    /// Name, kind and driver.
    pub text: String,
    /// True if the driver runs on the CPU.
    pub is_cpu: bool,
}

impl Device {
    /// Creates it from the device's description of itself.
    pub fn new(description: &DeviceDescription) -> Self {
        Device {
            text: format!("{} ({}, {})", description.name, description.kind, description.driver),
            is_cpu: description.kind == "CPU",
        }
    }

    /// Returns the unit in which the costs of frames are compared.
    pub fn unit(&self) -> &'static str {
        if self.is_cpu { "core-ms" } else { "device ms" }
    }
}

/// Everything that reports are made from.
pub struct Results<'a> {
    /// The configuration.
    pub config: &'a Config,
    /// Plan of the measurements.
    pub plan: &'a Plan,
    /// Sections that were asked for.
    pub sections: &'a [Section],
    /// Records, by key.
    pub records: &'a Records,
    /// Reasons why units have no record, by key.
    pub skipped: &'a std::collections::BTreeMap<String, String>,
    /// Device that measured.
    pub device: &'a Device,
    /// True if it was a quick run.
    pub quick: bool,
    /// Command line that repeats the measurement.
    pub command: &'a str,
}

impl Results<'_> {
    /// Returns the units of a section that have records, with these.
    pub fn units(&self, section: Section) -> impl Iterator<Item = (&Unit, &Record)> {
        self.plan
            .units
            .iter()
            .filter(move |unit| unit.section == section)
            .filter_map(|unit| Some((unit, self.records.get(&unit.key())?)))
    }
}
