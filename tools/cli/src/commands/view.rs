//! Shows splats in a window (`vgs view`).

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use engine::render::ObjectChange;
use engine::{Error, Kind, Result, transfer};
use view::io::sorting;
use view::model::region::Region;
use view::model::settings::Settings;
use view::model::state::{Files, ViewState};
use view::viewer::Start;
use view::window;

use crate::shared::failure::Stop;
use crate::shared::flags::{DeviceArguments, bytes};
use crate::shared::outputs;

/// Shows splats, the volume they were fitted to, or both, in a window
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct ViewArguments {
    /// What is shown: splats (PLY), a volume, a session (TOML, or packed as a zip); more can be dropped on the
    /// window
    files: Vec<PathBuf>,
    /// The volume that the splats were fitted to: the space bar flips between the two
    #[arg(long, value_name = "VOLUME")]
    volume: Option<PathBuf>,
    /// Splats to compare with: side by side with the others, by the same camera and transfer function
    #[arg(long, value_name = "SPLATS")]
    beside: Option<PathBuf>,
    /// Which series of a DICOM folder: its number in `vgs info`, its UID, or a part of its description
    #[arg(long, value_name = "N|TEXT")]
    series: Option<String>,
    /// Shows nothing of the volume outside this mask
    #[arg(long, value_name = "MASK")]
    roi: Option<PathBuf>,
    /// Transfer function: a preset, a file (.vp, .vp.json, .xml:NAME, ParaView .json), or window:WIDTH,LEVEL
    #[arg(long, value_name = "PRESET|FILE")]
    tf: Option<String>,
    /// How an object is shown, by name, number, range (1-24) or pattern (rib_*): colour=#rrggbb, opacity=0..1 (a factor of the opacity per
    /// mm), tf=CT-Bone (a transfer function of its own, in mode decoded), hidden. Each file is an object, or each of its
    /// labels; may be repeated
    #[arg(long, value_name = "NAME|N:HOW,...")]
    object: Vec<ObjectChange>,
    /// Most memory of the device for the field of the splats, as 64M or 2G: what is far or out of sight is shown coarser where
    /// that is too little, and becomes sharp when the view rests
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    field_memory: Option<u64>,
    /// At the end writes what was measured (JSON): times to the first picture, from edits to frames, of
    /// pictures
    #[arg(long, value_name = "FILE.json")]
    report: Option<PathBuf>,
    /// Replaces the report where it exists
    #[arg(short, long, requires = "report")]
    force: bool,
    #[command(flatten)]
    device: DeviceArguments,
}

const EXAMPLES: &str = "\
Examples:
  vgs view bones.ply
  vgs view bones.ply --volume ct.nii.gz --roi bones.nii.gz
  vgs view bones.ply vessels.ply --tf CT-Angio --object bones:opacity=0.2
  vgs view fine.ply --beside coarse.vgs
  vgs view scans/ --series 3       a folder of DICOM slices; `vgs info scans/` lists its series
  vgs view ct.nii.gz               G chooses a region and fits splats to it
  vgs view session.toml            or case.zip, as `vgs pack` makes it

Left button turns, middle moves, wheel zooms, right sets window and level; ? lists the keys.
For looking, not for diagnosis.";

/// Runs the command.
pub fn run(arguments: &ViewArguments, since: Instant) -> std::result::Result<u8, Stop> {
    if let Some(report) = &arguments.report {
        outputs::check(&[report], &[], arguments.force)?;
    }
    let (state, session) = arguments.state()?;
    let settings = Settings::read(Settings::place()).unwrap_or_else(|error| {
        tracing::warn!("{error}; continuing without");
        Settings::default()
    });
    let gpu = arguments.device.options();
    let objects = arguments.object.clone();
    let asked = arguments.tf.is_some();
    let report = window::run(Start { state, session, asked, objects, settings, gpu, since })?;
    if let Some(path) = &arguments.report {
        let text = serde_json::to_string_pretty(&report)
            .map_err(|e| Error::new(Kind::Internal, "VGS-CLI-095", format!("writing JSON failed: {e}")))?;
        engine::output::write_atomic(path, arguments.force, |out| out.write_all(text.as_bytes()))?;
    }
    Ok(0)
}

impl ViewArguments {
    /// Returns the state that is shown at first, and the file of the session that it is.
    fn state(&self) -> Result<(ViewState, Option<PathBuf>)> {
        let nothing = Files::default();
        let mut sorted = match sorting::needs_look(&nothing, &self.files) {
            true => sorting::sort_looking(&nothing, &self.files, None)?,
            false => sorting::sort(&nothing, &self.files)?,
        };
        sorted.notes.iter().for_each(|note| tracing::warn!("{note}"));
        let from_session = sorted.state().transpose()?;
        let is_session = from_session.is_some();
        let mut state = match from_session {
            Some(state) => state,
            // A function that is stretched over the intensities is stretched once they are read.
            None => ViewState::new(&transfer::load(
                self.tf.as_deref().unwrap_or(transfer::FIRST),
                [-1000.0, 3000.0],
            )?),
        };
        if let (true, Some(tf)) = (is_session, &self.tf) {
            state.transfer = view::model::transfer::Transfer::new(&transfer::load(tf, [-1000.0, 3000.0])?);
        }
        if !is_session {
            state.files = std::mem::take(&mut sorted.files);
        }
        state.field_memory = self.field_memory;
        if self.volume.is_some() {
            state.files.volume.clone_from(&self.volume);
        }
        if let Some(mask) = &self.roi {
            state.files.set_region(Some(Region::Mask { path: mask.clone(), labels: None }));
        }
        if self.series.is_some() {
            if state.files.volume.is_none() {
                return Err(Error::new(Kind::Usage, "VGS-CLI-121", "--series is one of a DICOM folder")
                    .help("give the folder, too: vgs view FOLDER --series N"));
            }
            state.files.series.clone_from(&self.series);
        }
        if let Some(path) = &self.beside {
            sorting::put_beside(&mut state, path.clone())?;
        }
        if state.files.roi.is_some() && state.files.volume.is_none() {
            return Err(Error::new(Kind::Usage, "VGS-CLI-096", "--roi is the region of a volume")
                .help("name the volume with --volume"));
        }
        // The window asks for those of a session.
        if !is_session {
            state.files.all().try_for_each(|file| exists(file))?;
        }
        let named = [&self.volume, &self.roi, &self.beside].into_iter().flatten();
        named.chain(&self.files).try_for_each(|file| exists(file))?;
        Ok((state, sorted.session))
    }
}

/// Returns an error for a file that does not exist, before the window opens.
fn exists(path: &Path) -> Result<()> {
    std::fs::metadata(path).map(|_| ()).map_err(|e| Error::io(path, "opening", &e))
}
