//! Devices that are known by their data sheet: a file of rates each, and the time of a frame by a roofline.

use std::fs;
use std::path::Path;

use engine::{Error, Kind, Result};
use serde::{Deserialize, Serialize};

use super::stages::{Demand, STAGES};
use super::work::Work;

/// The devices that come with the program; another one is another file and another row.
const DEVICES: [(&str, &str); 1] = [("adreno-740.toml", include_str!("devices/adreno-740.toml"))];

/// A rate and how much of it programs reach.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rate {
    /// A second, by the data sheet.
    pub peak: f64,
    /// Share of it that is taken to be reached: by a program that suits the device badly, and by one that suits it well.
    pub reached: [f64; 2],
    /// Where the figures are from.
    pub source: String,
}

/// What each dispatch or draw takes besides its work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Overhead {
    /// Most and least, microseconds.
    pub us: [f64; 2],
    /// Where the figures are from.
    pub source: String,
}

/// A device by its rates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Device {
    /// What it is called.
    pub name: String,
    /// Whether its groups are as wide as a tile, 64 invocations: those of GPUs are.
    pub wide: bool,
    /// Operations of 32-bit floats; a fused multiply-add is two.
    pub flops: Rate,
    /// Bytes of memory.
    pub bytes: Rate,
    /// Fragments.
    pub pixels: Rate,
    /// Of a dispatch.
    pub dispatch: Overhead,
}

/// What limits a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Limit {
    /// Operations.
    Operations,
    /// Memory.
    Memory,
    /// The rasterizer.
    Fragments,
}

/// Time of a stage at one end of the range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Time {
    /// With its dispatches, ms.
    pub ms: f64,
    /// What takes the longest.
    pub limit: Limit,
}

impl Device {
    /// From a file.
    ///
    /// # Errors
    /// [`Kind::BadData`] if it is no such file, or if a rate is none: not positive, or a share that is not from 0 to 1.
    pub fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).map_err(|e| Error::io(path, "reading", &e))?;
        Self::parse(&text).map_err(|e| e.file(path))
    }

    fn parse(text: &str) -> Result<Self> {
        let bad = |message: String| Error::new(Kind::BadData, "VGS-BEN-040", message);
        let device: Device = toml::from_str(text).map_err(|e| bad(format!("this is no device: {e}")))?;
        for (what, rate) in [("flops", &device.flops), ("bytes", &device.bytes), ("pixels", &device.pixels)] {
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

    /// Those that come with the program.
    ///
    /// # Panics
    /// If one of them is in disorder, which a test sees to.
    pub fn known() -> Vec<Self> {
        let parse = |(name, text): (&str, &str)| Self::parse(text).unwrap_or_else(|e| panic!("{name}: {e}"));
        DEVICES.map(parse).into()
    }

    /// Times of the stages of a frame: `end` 0 where the device does badly, 1 where it does well. The longest of what operations,
    /// memory and fragments take, for they go on side by side, and the dispatches. Stages wait for each other.
    pub fn stages(&self, work: &Work, end: usize) -> Vec<Time> {
        let seconds = |count: f64, rate: &Rate| count / (rate.peak * rate.reached[end]);
        let time = |demand: Demand| {
            let parts = [
                (Limit::Operations, seconds(demand.ops, &self.flops)),
                (Limit::Memory, seconds(demand.bytes, &self.bytes)),
                (Limit::Fragments, seconds(demand.fills, &self.pixels)),
            ];
            let (limit, longest) =
                parts.into_iter().fold(parts[0], |most, part| if part.1 > most.1 { part } else { most });
            Time { ms: longest * 1e3 + demand.dispatches * self.dispatch.us[end] * 1e-3, limit }
        };
        STAGES.iter().map(|stage| time(Demand::of(stage, work, self.wide))).collect()
    }

    /// Time of a frame, ms: where the device does badly, and where it does well.
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
            dispatch: Overhead { us: [10.0, 5.0], source: "made up".into() },
        }
    }

    #[test]
    fn a_stage_takes_as_long_as_what_takes_longest_in_it() {
        let wide = Pixels { evaluations: 1e9, ..Pixels::default() };
        let slab = Work { mode: "slab".into(), wide, ..Work::default() };
        let at = STAGES.iter().position(|s| s.name == "slab").expect("a stage");
        let [slow, fast] = [0, 1].map(|end| device().stages(&slab, end)[at]);
        // A thousand million evaluations at a quarter and at half of 1e12 operations a second, and a dispatch.
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
