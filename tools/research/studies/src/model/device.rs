//! Devices that are known by their data sheets: reads a file of rates for each, and predicts the time of a
//! frame by a roofline.

use std::fs;
use std::path::Path;

use engine::{Error, Kind, Result};
use serde::{Deserialize, Serialize};

use super::stages::{Demand, STAGES};
use super::work::Work;

/// Devices that come with the program. Another device needs another file and another row.
const DEVICES: [(&str, &str); 1] = [("adreno-740.toml", include_str!("devices/adreno-740.toml"))];

/// Rate of a device, and how much of it programs reach.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rate {
    /// Peak rate per second, by the data sheet.
    pub peak: f64,
    /// Shares of the peak that are assumed to be reached: by a program that suits the device badly, and by
    /// one that suits it well.
    pub reached: [f64; 2],
    /// Where the figures are from.
    pub source: String,
}

/// Time that each dispatch or draw takes besides its work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Overhead {
    /// Most and least time, microseconds.
    pub us: [f64; 2],
    /// Where the figures are from.
    pub source: String,
}

/// Device, described by its rates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Device {
    /// Name of the device.
    pub name: String,
    /// True if its workgroups have 64 invocations, as those of GPUs have.
    pub wide: bool,
    /// Rate of operations on 32-bit floats; a fused multiply-add counts as two.
    pub flops: Rate,
    /// Rate of memory traffic in bytes.
    pub bytes: Rate,
    /// Rate of fragments.
    pub pixels: Rate,
    /// Trilinear samples of images of two 16-bit channels.
    pub samples: Rate,
    /// Overhead of a dispatch or draw.
    pub dispatch: Overhead,
}

/// Resource that limits a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Limit {
    /// Operations on floats.
    Operations,
    /// Memory traffic.
    Memory,
    /// Fragments that the rasterizer fills.
    Fragments,
    /// Texture units.
    Samples,
}

/// Time of a stage at one end of the range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Time {
    /// Time with the overhead of the dispatches, ms.
    pub ms: f64,
    /// Resource that takes the longest.
    pub limit: Limit,
}

impl Device {
    /// Reads a device from a TOML file.
    ///
    /// # Errors
    /// Returns [`Kind::BadData`] if the file does not describe a device, if a peak is not positive and
    /// finite, if the shares of a rate are not above 0, at most 1 and in ascending order, or if the times of
    /// a dispatch are not finite, at least 0, and the greater one first.
    pub fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).map_err(|e| Error::io(path, "reading", &e))?;
        Self::parse(&text).map_err(|e| e.file(path))
    }

    fn parse(text: &str) -> Result<Self> {
        let bad = |message: String| Error::new(Kind::BadData, "VGS-BEN-040", message);
        let device: Device = toml::from_str(text).map_err(|e| bad(format!("this is no device: {e}")))?;
        for (what, rate) in [
            ("flops", &device.flops),
            ("bytes", &device.bytes),
            ("pixels", &device.pixels),
            ("samples", &device.samples),
        ] {
            let [low, high] = rate.reached;
            if !(rate.peak > 0.0 && rate.peak.is_finite() && 0.0 < low && low <= high && high <= 1.0) {
                return Err(bad(format!(
                    "{what}: {} a second, of which {low} to {high} are reached",
                    rate.peak
                ))
                .help("a peak above 0, and two shares of it above 0 and at most 1, the lower one first"));
            }
        }
        let [most, least] = device.dispatch.us;
        if !(least >= 0.0 && most >= least && most.is_finite()) {
            return Err(bad(format!("dispatch: {most} to {least} microseconds")).help("most, then least"));
        }
        Ok(device)
    }

    /// Returns the devices that come with the program.
    ///
    /// # Panics
    /// Panics if one of them is not valid; a test prevents that.
    pub fn known() -> Vec<Self> {
        let parse = |(name, text): (&str, &str)| Self::parse(text).unwrap_or_else(|e| panic!("{name}: {e}"));
        DEVICES.map(parse).into()
    }

    /// Returns the time of each stage of a frame; `end` is 0 for the slow end of the range and 1 for the fast
    /// one. A stage takes as long as the longest of its operations, memory traffic, fragments and samples, which
    /// overlap, and the overhead of its dispatches. Stages wait for each other, so that their times add up.
    pub fn stages(&self, work: &Work, end: usize) -> Vec<Time> {
        let seconds = |count: f64, rate: &Rate| count / (rate.peak * rate.reached[end]);
        let time = |demand: Demand| {
            let parts = [
                (Limit::Operations, seconds(demand.ops, &self.flops)),
                (Limit::Memory, seconds(demand.bytes, &self.bytes)),
                (Limit::Fragments, seconds(demand.fills, &self.pixels)),
                (Limit::Samples, seconds(demand.samples, &self.samples)),
            ];
            let (limit, longest) =
                parts.into_iter().fold(parts[0], |most, part| if part.1 > most.1 { part } else { most });
            Time { ms: longest * 1e3 + demand.dispatches * self.dispatch.us[end] * 1e-3, limit }
        };
        STAGES.iter().map(|stage| time(Demand::of(stage, work, self.wide))).collect()
    }

    /// Returns the time of a frame at the slow and at the fast end of the range, ms.
    pub fn range(&self, work: &Work) -> [f64; 2] {
        [0, 1].map(|end| self.stages(work, end).iter().map(|t| t.ms).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::work::Pixels;

    fn device() -> Device {
        let rate = |peak: f64| Rate { peak, reached: [0.25, 0.5], source: "made up".into() };
        Device {
            name: "a device".into(),
            wide: true,
            flops: rate(1e12),
            bytes: rate(1e10),
            pixels: rate(1e10),
            samples: rate(1e10),
            dispatch: Overhead { us: [10.0, 5.0], source: "made up".into() },
        }
    }

    #[test]
    fn a_stage_takes_as_long_as_what_takes_longest_in_it() {
        let wide = Pixels { evaluations: 1e9, ..Pixels::default() };
        let slab = Work { mode: "slab".into(), wide, ..Work::default() };
        let at = STAGES.iter().position(|s| s.name == "slab").expect("a stage");
        let [slow, fast] = [0, 1].map(|end| device().stages(&slab, end)[at]);
        // A thousand million evaluations at a quarter and at half of 1e12 operations a second, and a
        // dispatch.
        let ops = STAGES[at].terms[0].ops;
        assert!(
            (slow.ms - (4.0 * ops + 0.01)).abs() < 1e-9 && (fast.ms - (2.0 * ops + 0.005)).abs() < 1e-9,
            "{slow:?} {fast:?}"
        );
        assert_eq!(slow.limit, Limit::Operations);
        let much = Work { pixels: 1e9, pixel_bytes: 8.0, ..slab.clone() };
        assert_eq!(device().stages(&much, 0)[at].limit, Limit::Memory);
        let alpha = Work { mode: "alpha".into(), fragments: 1e9, ..Work::default() };
        let draw = STAGES.iter().position(|s| s.name == "draw").expect("a stage");
        let time = device().stages(&alpha, 1)[draw];
        assert!(
            time.limit == Limit::Fragments && (time.ms - 1e9 * 0.7698 / 5e9 * 1e3).abs() < 0.1,
            "{time:?}"
        );
        let rays = Pixels { samples: 1e9, ..Pixels::default() };
        let decoded = Work { mode: "decoded".into(), wide: rays, ..Work::default() };
        let march = STAGES.iter().position(|s| s.name == "march").expect("a stage");
        // A thousand million samples at half of as many a second, and a dispatch.
        let slow_units = Device { samples: Rate { peak: 1e9, ..device().samples }, ..device() };
        let sampled = slow_units.stages(&decoded, 1)[march];
        assert!(sampled.limit == Limit::Samples && (sampled.ms - 2000.005).abs() < 1e-6, "{sampled:?}");
        let [slow, fast] = device().range(&alpha);
        assert!(slow > fast && fast > time.ms, "the dispatches of the sort as well: {slow} {fast}");
    }

    #[test]
    fn devices_are_in_order_and_what_is_none_is_refused() {
        let known = Device::known();
        assert!(known.len() == DEVICES.len() && known.iter().all(|d| d.flops.source.len() > 20));
        let good = toml::to_string(&device()).expect("TOML");
        assert_eq!(Device::parse(&good).expect("a device"), device());
        let reached = "reached = [0.25, 0.5]";
        for (from, to) in [
            (reached, "reached = [0.5, 0.25]"),
            (reached, "reached = [0.25, 1.5]"),
            ("us = [10.0, 5.0]", "us = [5.0, 10.0]"),
            ("wide = true", "wide = 64"),
            ("wide = true", "wide = true\ncores = 6"),
        ] {
            let error = Device::parse(&good.replacen(from, to, 1)).expect_err(to);
            assert_eq!((error.code, error.kind), ("VGS-BEN-040", Kind::BadData), "{to}: {error}");
        }
    }
}
