//! Files that a fit writes.

use std::path::{Path, PathBuf};

use engine::fit::{End, Outcome};
use engine::output::write_atomic;
use engine::{Error, Kind, Result, splat};

use super::arguments::FitArguments;
use crate::report::curve;
use crate::report::record::RunRecord;
use crate::shared::lock::Lock;
use crate::shared::outputs;
use crate::shared::signals::Signals;

/// Outputs of a fit.
pub struct OutputFiles {
    /// File of the splats.
    pub splats: PathBuf,
    record: PathBuf,
    csv: PathBuf,
    svg: PathBuf,
    /// Picture of the closing evaluation, if one was asked for.
    pub picture: Option<PathBuf>,
}

impl OutputFiles {
    /// Returns the outputs that the flags name, once it is certain that they can be written.
    pub fn checked(arguments: &FitArguments) -> Result<Self> {
        let files = OutputFiles::of(&arguments.output, arguments.picture.clone());
        files.check(arguments)?;
        check_extension(&files.splats)?;
        Ok(files)
    }

    fn of(splats: &Path, picture: Option<PathBuf>) -> Self {
        OutputFiles {
            splats: splats.to_owned(),
            record: outputs::beside(splats, ".run.json"),
            csv: outputs::beside(splats, ".csv"),
            svg: outputs::beside(splats, ".svg"),
            picture,
        }
    }

    /// Returns the outputs of a fit with this `end`. An unfinished fit does not replace the outputs of a
    /// finished one but writes beside them.
    pub fn after(&self, end: &End) -> Self {
        let finished = matches!(end, End::Finished);
        if finished || !self.splats.exists() || self.holds_an_unfinished_fit() {
            return OutputFiles::of(&self.splats, self.picture.clone());
        }
        OutputFiles::of(&outputs::beside(&self.splats, ".unfinished.ply"), None)
    }

    /// Returns true if the record beside the splats says that their fit was stopped or has failed.
    fn holds_an_unfinished_fit(&self) -> bool {
        let record = std::fs::read_to_string(&self.record).unwrap_or_default();
        let record: serde_json::Value = serde_json::from_str(&record).unwrap_or_default();
        record["end"].as_str().is_some_and(|end| end != "finished")
    }

    fn check(&self, arguments: &FitArguments) -> Result<()> {
        outputs::check(&self.list(), &arguments.inputs(), arguments.replaces_outputs())
    }

    /// Locks the outputs for this process; a dry run needs no lock.
    pub fn lock(&self, arguments: &FitArguments, signals: &Signals) -> Result<Option<Lock>> {
        let lock = if arguments.dry_run { None } else { Some(Lock::take(&self.splats, signals)?) };
        // Another run may have written them before it released the lock.
        self.check(arguments)?;
        Ok(lock)
    }

    /// Returns all outputs, the splats first.
    pub fn list(&self) -> Vec<&Path> {
        let mut list = vec![self.splats.as_path(), &self.record, &self.csv, &self.svg];
        list.extend(self.picture.as_deref());
        list
    }

    /// Writes the record and the curve, as a table and as a plot. The title names the volume and its `unit`.
    pub fn write_reports(
        &self,
        record: &RunRecord<'_>,
        outcome: &Outcome,
        (volume, unit): (&Path, &str),
        force: bool,
    ) -> Result<()> {
        let json = serde_json::to_string_pretty(record).map_err(|e| {
            Error::new(Kind::Internal, "VGS-CLI-003", format!("a result cannot be written as JSON: {e}"))
        })?;
        let name = volume.file_name().unwrap_or_default().to_string_lossy();
        let title = format!("{name}: {} splats", outcome.splats.len());
        let plot = curve::svg(&outcome.curve, &title, outcome.range, unit)?;
        let put = |path: &Path, text: &str| write_atomic(path, force, |out| out.write_all(text.as_bytes()));
        put(&self.record, &(json + "\n"))?;
        put(&self.csv, &curve::csv(&outcome.curve))?;
        put(&self.svg, &plot)
    }
}

/// Returns an error if the extension names no format of splats with intensities, so that this is not found out
/// after the fit.
fn check_extension(path: &Path) -> Result<()> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let formats = || splat::FORMATS.iter().filter(|format| !format.coloured);
    if formats().any(|format| format.name.eq_ignore_ascii_case(&extension)) {
        return Ok(());
    }
    let names: Vec<_> = formats().map(|format| format!(".{}", format.name)).collect();
    let names = names.join(", ");
    if splat::is_coloured(path) {
        let message = format!("a .{extension} file holds colours, and a fit makes splats with intensities");
        return Err(Error::new(Kind::Usage, "VGS-CLI-133", message)
            .file(path)
            .help(format!("fit to one of {names}, then: vgs convert SPLATS -o OUT.{extension}")));
    }
    Err(Error::new(Kind::Usage, "VGS-CLI-022", "the extension names no splat format")
        .file(path)
        .help(format!("known: {names}")))
}
