//! Codes the region of a volume, without splats.

use std::io::Read;
use std::path::Path;

use engine::coded::{coded, usual_bound};
use engine::splat::{self, WriteOptions};
use engine::{Error, Kind};
use view::model::state::is_session;

use super::arguments::ConvertArguments;
use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::bytes;
use crate::shared::inputs::{Case, is_volume};
use crate::shared::outputs;
use crate::shared::waiting::Waiting;

/// Returns true if what is to be converted is a volume.
pub fn is_of_volume(path: &Path) -> engine::Result<bool> {
    if path.is_dir() {
        return Ok(true);
    }
    if !is_volume(path) || is_session(path) {
        return Ok(false);
    }
    let mut start = Vec::new();
    engine::input::open(path)
        .and_then(|file| file.take(splat::SNIFF_BYTES).read_to_end(&mut start))
        .map_err(|error| Error::io(path, "reading", &error))?;
    Ok(!splat::is_splats(path, &start))
}

/// Codes the region of the volume.
pub fn run(arguments: &ConvertArguments, console: &Console) -> Result<u8, Stop> {
    let (path, output) = (arguments.first(), &arguments.output);
    arguments.check_coded()?;
    let inputs: Vec<&Path> = [Some(path), arguments.roi.as_deref()].into_iter().flatten().collect();
    outputs::check(&[output], &inputs, arguments.force)?;
    let (case, labels) = Case::read_labelled(path, &arguments.read, &arguments.region())?;
    let waiting = Waiting::on("coding the region");
    let wanted = arguments.bound.unwrap_or_else(|| usual_bound(&case.volume, &case.roi));
    let set = coded(&case.volume, &case.roi, labels.as_ref(), wanted).map_err(|error| error.file(path))?;
    splat::write_as(output, &set, &WriteOptions { force: arguments.force, ..WriteOptions::default() })?;
    drop(waiting);
    let size = std::fs::metadata(output).map_or(0, |found| found.len());
    let count = set.coded_count();
    let bound = set.voxels.iter().map(|voxels| voxels.precision.bound()).fold(0.0, f64::max);
    if console.json {
        console.json_data(&serde_json::json!({
            "output": output, "splats": 0, "voxels": count, "bound": bound, "bytes": size,
        }))?;
        return Ok(0);
    }
    let unit = set.unit.text();
    let how = match bound > 0.0 {
        true => format!("none off by more than {}{unit}", (bound * 1e6).round() / 1e6),
        false => "as they are".to_owned(),
    };
    console.say(&format!(
        "{}: {count} voxels, {how}, {} ({:.2} bytes a voxel)",
        output.display(),
        bytes(size),
        size as f64 / count.max(1) as f64,
    ));
    Ok(0)
}

impl ConvertArguments {
    /// Fails if flags do not go with a volume.
    fn check_coded(&self) -> engine::Result<()> {
        let usage = |code, message: String, help: &str| {
            Err(Error::new(Kind::Usage, code, message).file(self.first()).help(help))
        };
        if self.roi.is_none() && self.roi_threshold.is_none() {
            let message = "this is a volume, and the region is missing that is to be coded".to_owned();
            return usage("VGS-CLI-166", message, "give --roi MASK, or --roi-threshold LOW,HIGH");
        }
        let for_splats = [
            (self.like.is_some(), "--like"),
            (self.tf.is_some(), "--tf"),
            (self.object_colours, "--object-colours"),
            (!self.clip.is_empty(), "--clip"),
            (self.inside.is_some(), "--box"),
            (self.outside_box.is_some(), "--outside-box"),
            (!self.object.is_empty(), "--object"),
            (self.volume.is_some(), "--volume"),
            (self.page.first().is_some(), "a flag of pages"),
            (self.splats.len() > 1, "another file"),
        ];
        if let Some((_, flag)) = for_splats.iter().find(|(given, _)| *given) {
            let message = format!("{flag} beside a volume, whose region is coded");
            return usage("VGS-CLI-167", message, "code the region first, and convert what comes of it");
        }
        if !self.output.extension().is_some_and(|end| end.eq_ignore_ascii_case("vgs")) {
            let message = "only a .vgs holds the coded region of a volume".to_owned();
            return Err(Error::new(Kind::Usage, "VGS-CLI-168", message)
                .file(&self.output)
                .help("write a .vgs, and convert that to a page, or fit splats: vgs fit"));
        }
        Ok(())
    }
}
