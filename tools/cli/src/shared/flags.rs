//! Flags that several commands have, and parsers of their values.

use std::str::FromStr;

use clap::Args;
use engine::render::ClipPlane;
use engine::unit::Unit;
use engine::volume::BetweenSlices;
use glam::DVec3;

use super::waiting::Waiting;

/// Flags for the device.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Device")]
pub struct DeviceArguments {
    /// Vulkan device: its number in `vgs devices` or part of its name; the fastest kind by default
    #[arg(long, value_name = "N|NAME", env = "VGS_DEVICE", hide_env = true)]
    pub device: Option<String>,
    /// Largest storage-buffer range that is used, bytes: to see on any device what a small one does
    #[arg(long, value_name = "BYTES", value_parser = bytes, env = "VGS_FORCE_SSBO_LIMIT", hide = true)]
    pub storage_range_limit: Option<u64>,
}

impl DeviceArguments {
    /// Returns the options with which the device is booted.
    pub fn options(&self) -> engine::gpu::GpuOptions {
        engine::gpu::GpuOptions {
            device: self.device.clone(),
            storage_range_limit: self.storage_range_limit,
            ..Default::default()
        }
    }

    /// Boots the device.
    pub fn boot(&self) -> engine::Result<engine::gpu::Gpu> {
        let _waiting = Waiting::on("starting the device");
        let gpu = engine::gpu::Gpu::new(&self.options())?;
        let chosen = gpu.description();
        tracing::info!("device: {} ({}, {})", chosen.name, chosen.kind, chosen.driver);
        Ok(gpu)
    }
}

/// Parses the name of what lies between thick slices.
pub fn between_slices(text: &str) -> Result<BetweenSlices, String> {
    let row = BetweenSlices::NAMES.into_iter().find(|(name, _)| *name == text);
    row.map(|(_, between)| between).ok_or_else(|| "smooth or linear".to_owned())
}

/// Width and height, pixels.
#[derive(Clone, Copy, Debug)]
pub struct Size(pub [u32; 2]);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides: Result<Vec<u32>, _> = text.split(['x', 'X', ',']).map(|t| t.trim().parse()).collect();
        let size = match sides.as_deref() {
            Ok(&[n]) => [n, n],
            Ok(&[w, h]) => [w, h],
            _ => return Err("width and height are needed, as 1920x1080".into()),
        };
        if size.iter().all(|n| (1..=16384).contains(n)) {
            Ok(Size(size))
        } else {
            Err("1 to 16384 pixels".into())
        }
    }
}

/// A box between two corners, the lower one first, mm RAS.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners(pub [DVec3; 2]);

impl FromStr for Corners {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|t| t.trim().parse::<f64>()).collect();
        match numbers.as_deref() {
            Ok(n) if n.len() == 6 && n.iter().all(|v| v.is_finite()) => {
                let (a, b) = (DVec3::from_slice(&n[..3]), DVec3::from_slice(&n[3..]));
                Ok(Corners([a.min(b), a.max(b)]))
            }
            _ => Err("two corners are needed, X0,Y0,Z0,X1,Y1,Z1 (mm, patient RAS)".into()),
        }
    }
}

/// Parses the first voxel and the one behind the last along each axis, as `0:512,100:400,0:90`.
pub fn voxels(text: &str) -> Result<[[usize; 2]; 3], String> {
    let ends = |range: &str| {
        let (first, end) = range.split_once(':')?;
        let ends = [first.trim().parse().ok()?, end.trim().parse().ok()?];
        (ends[0] < ends[1]).then_some(ends)
    };
    let ranges: Option<Vec<[usize; 2]>> = text.split(',').map(ends).collect();
    let ranges = ranges.and_then(|ranges| ranges.try_into().ok());
    ranges.ok_or_else(|| {
        "three ranges are needed, the first number below the second: 0:512,100:400,0:90".into()
    })
}

/// Parses `LOW,HIGH`.
pub fn pair(text: &str) -> Result<[f32; 2], String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(|t| t.trim().parse::<f32>()).collect();
    match numbers.as_deref() {
        Ok(&[low, high]) if low.is_finite() && high.is_finite() => Ok([low, high]),
        _ => Err("two numbers with a comma between are needed, as -1024,3071".into()),
    }
}

/// Parses `LOW,HIGH` with LOW below HIGH.
pub fn range(text: &str) -> Result<[f32; 2], String> {
    match pair(text)? {
        [low, high] if low < high => Ok([low, high]),
        _ => Err("the first number must be the lower one".into()),
    }
}

/// Range of a PSNR.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Least to greatest intensity of each volume itself.
    Own,
    /// Least to greatest intensity of the volume inside the region.
    Roi,
    /// Given least and greatest intensity.
    Given([f32; 2]),
}

/// Parses `LOW,HIGH` or `roi`.
pub fn range_or_roi(text: &str) -> Result<Range, String> {
    match text.trim() {
        "roi" => Ok(Range::Roi),
        text => range(text).map(Range::Given).map_err(|e| format!("{e}; or roi")),
    }
}

/// Parses `LOW,HIGH`, `roi` or `own`.
pub fn any_range(text: &str) -> Result<Range, String> {
    match text.trim() {
        "own" => Ok(Range::Own),
        text => range_or_roi(text).map_err(|e| format!("{e} or own")),
    }
}

/// Parses a number of bytes with an optional suffix K, M, G or T (powers of 1024).
pub fn bytes(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let power = text.chars().last().and_then(|c| "KMGT".find(c.to_ascii_uppercase()));
    let (digits, shift) = match power {
        Some(index) => (&text[..text.len() - 1], 10 * (index as u32 + 1)),
        None => (text, 0),
    };
    digits
        .parse::<u64>()
        .ok()
        .and_then(|n| n.checked_mul(1 << shift))
        .filter(|&n| n > 0)
        .ok_or_else(|| "a number of bytes is needed, as 4G or 500000000".into())
}

/// Parses `on` or `off`.
pub fn on_off(text: &str) -> Result<bool, String> {
    match text {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err("on or off".into()),
    }
}

/// Parses a duration: `90s`, `5m`, `1.5h`, or seconds.
pub fn duration(text: &str) -> Result<std::time::Duration, String> {
    let text = text.trim();
    let (number, unit) = match text.strip_suffix(['s', 'm', 'h']) {
        Some(number) => (number, text.as_bytes()[text.len() - 1]),
        None => (text, b's'),
    };
    let seconds = number.parse::<f64>().ok().map(|n| {
        n * match unit {
            b'm' => 60.0,
            b'h' => 3600.0,
            _ => 1.0,
        }
    });
    match seconds {
        Some(s) if (0.1..1e7).contains(&s) => Ok(std::time::Duration::from_secs_f64(s)),
        _ => Err("a time such as 90s, 5m or 1.5h is needed".into()),
    }
}

/// Parses what the values of a volume are numbers of.
pub fn unit(text: &str) -> Result<Unit, String> {
    let found = Unit::from_name(text).filter(|unit| unit.is_physical());
    found.ok_or_else(|| "hu, of a CT, or arbitrary, of any other scan, is needed".into())
}

/// Parses one spacing or three, mm.
pub fn spacing(text: &str) -> Result<DVec3, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|t| t.trim().parse::<f64>()).collect();
    let spacing = match numbers.as_deref() {
        Ok(&[s]) => DVec3::splat(s),
        Ok(&[x, y, z]) => DVec3::new(x, y, z),
        _ => return Err("one number or three with commas between are needed, mm".into()),
    };
    let sensible = spacing.is_finite() && spacing.min_element() >= 1e-3 && spacing.max_element() <= 1e3;
    if sensible { Ok(spacing) } else { Err("0.001 to 1000 mm".into()) }
}

/// Clip planes.
#[derive(Clone, Debug)]
pub struct Clip(pub Vec<ClipPlane>);

impl FromStr for Clip {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "x<MM, y>MM and the like, or box:X0,Y0,Z0,X1,Y1,Z1 (mm, patient RAS)".to_owned();
        if let Some(corners) = text.strip_prefix("box:") {
            let Corners([low, high]) = corners.parse().map_err(|_| wrong())?;
            return Ok(Clip(ClipPlane::around(low, high).to_vec()));
        }
        let mut letters = text.trim().chars();
        let axis = match letters.next().map(|c| c.to_ascii_lowercase()) {
            Some('x') => DVec3::X,
            Some('y') => DVec3::Y,
            Some('z') => DVec3::Z,
            _ => return Err(wrong()),
        };
        let side = letters.next();
        let at: f64 = letters.as_str().trim().parse().map_err(|_| wrong())?;
        match side {
            _ if !at.is_finite() => Err(wrong()),
            Some('<') => Ok(Clip(vec![ClipPlane { normal: axis, offset: at }])),
            Some('>') => Ok(Clip(vec![ClipPlane { normal: -axis, offset: -at }])),
            _ => Err(wrong()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_and_ranges() {
        assert_eq!(pair("-1024,3071"), Ok([-1024.0, 3071.0]));
        assert_eq!(pair(" 1 , 2e3 "), Ok([1.0, 2000.0]));
        assert_eq!(range("1,2"), Ok([1.0, 2.0]));
        for text in ["", "1", "1,2,3", "a,b", "nan,1", "1,inf", "1;2"] {
            assert!(pair(text).is_err(), "{text}");
        }
        assert!(range("2,1").is_err() && range("1,1").is_err());
        assert_eq!(range_or_roi("roi"), Ok(Range::Roi));
        assert_eq!(range_or_roi("-5,5"), Ok(Range::Given([-5.0, 5.0])));
        assert_eq!(any_range("own"), Ok(Range::Own));
        assert!(range_or_roi("own").is_err_and(|e| e.contains("or roi")));
        assert!(any_range("mine").is_err_and(|e| e.contains("or roi or own")));
    }

    #[test]
    fn ranges_of_voxels() {
        assert_eq!(voxels("0:512, 100:400,0:1"), Ok([[0, 512], [100, 400], [0, 1]]));
        for text in [
            "",
            "0:5",
            "0:5,0:5",
            "0:5,0:5,5:5",
            "0:5,0:5,6:5",
            "0:5,0:5,-1:5",
            "0:5,0:5,0:5,0:5",
            "0-5,0:5,0:5",
        ] {
            assert!(voxels(text).is_err(), "{text}");
        }
    }

    #[test]
    fn clips_keep_one_side() {
        let behind = "y>20".parse::<Clip>().unwrap().0[0];
        // Everything with y > 20 is cut away.
        assert!(behind.normal.dot(DVec3::new(0.0, 21.0, 0.0)) < behind.offset);
        assert!(behind.normal.dot(DVec3::new(0.0, 19.0, 0.0)) > behind.offset);
        let kept = "box:10,0,0,-10,5,5".parse::<Clip>().unwrap().0;
        assert!(kept.iter().all(|p| p.normal.dot(DVec3::new(0.0, 1.0, 1.0)) > p.offset));
        assert!(kept.iter().any(|p| p.normal.dot(DVec3::new(11.0, 1.0, 1.0)) < p.offset));
        for text in ["", "x", "x<", "w<3", "x=3", "x<nan", "box:1,2,3", "é<3"] {
            assert!(text.parse::<Clip>().is_err(), "{text}");
        }
    }

    #[test]
    fn bytes_and_durations() {
        for (text, expected) in [("1", 1), ("500000000", 500_000_000), ("4G", 4 << 30), ("2k", 2048)] {
            assert_eq!(bytes(text), Ok(expected), "{text}");
        }
        for text in ["", "G", "-1", "0", "1.5G", "99999999T", "ü"] {
            assert!(bytes(text).is_err(), "{text}");
        }
        for (text, seconds) in [("90", 90.0), ("90s", 90.0), ("5m", 300.0), ("1.5h", 5400.0)] {
            assert_eq!(duration(text).map(|d| d.as_secs_f64()), Ok(seconds), "{text}");
        }
        for text in ["", "s", "-1s", "0", "nan", "inf", "5 minutes"] {
            assert!(duration(text).is_err(), "{text}");
        }
    }

    #[test]
    fn sizes() {
        assert_eq!("1920x1080".parse::<Size>().unwrap().0, [1920, 1080]);
        assert_eq!("64".parse::<Size>().unwrap().0, [64, 64]);
        for text in ["", "0x5", "5x", "1x2x3", "99999x1", "-1x4"] {
            assert!(text.parse::<Size>().is_err(), "{text}");
        }
    }

    #[test]
    fn boxes() {
        let corners = [DVec3::new(-1.0, -2.0, 3.0), DVec3::new(4.0, 5.0, 6.5)];
        for text in ["-1,-2,3,4,5,6.5", "4, 5, 6.5, -1, -2, 3", "4,-2,6.5,-1,5,3"] {
            assert_eq!(text.parse(), Ok(Corners(corners)), "{text}");
        }
        for text in ["", "1,2,3", "1,2,3,4,5,nan", "1,2,3,4,5,6,7"] {
            assert!(text.parse::<Corners>().is_err(), "{text}");
        }
    }

    #[test]
    fn units() {
        assert_eq!((unit("hu"), unit("arbitrary")), (Ok(Unit::Hu), Ok(Unit::Arbitrary)));
        assert!(unit("luminance").is_err() && unit("HU ").is_err());
    }

    #[test]
    fn spacings() {
        assert_eq!(spacing("0.5"), Ok(DVec3::splat(0.5)));
        assert_eq!(spacing("1,2,3"), Ok(DVec3::new(1.0, 2.0, 3.0)));
        for text in ["", "0", "-1", "1,2", "nan", "1e9"] {
            assert!(spacing(text).is_err(), "{text}");
        }
    }
}
