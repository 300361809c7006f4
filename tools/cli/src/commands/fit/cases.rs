//! The cases of a batch: rows of a table, or the scans and masks of a folder in the layout of BIDS.

use std::any::TypeId;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::{Arg, ArgAction, Args, Command};
use engine::{Error, Kind, Result};

use super::arguments::FitArguments;

/// Flags that are the batch's own.
const OURS: [&str; 7] = ["output", "force", "resume", "dry-run", "explain", "device", "checkpoint-every"];
/// Suffixes of masks in BIDS' layout: of one structure, and of labels.
const MASKS: [&str; 2] = ["mask", LABELS];
const LABELS: &str = "dseg";

/// A case of a batch.
#[derive(Debug, PartialEq)]
pub struct Case {
    /// Name of its outputs.
    pub name: String,
    /// Flags that those of the batch come before.
    pub usual: Vec<OsString>,
    /// Arguments of its fit, but for the output.
    pub arguments: Vec<OsString>,
}

/// Returns the flags of a fit, as a command line.
pub fn command() -> Command {
    FitArguments::augment_args(Command::new("vgs fit")).args_override_self(true).no_binary_name(true)
}

/// Reads the cases of a table (CSV) or of a folder in BIDS' layout.
///
/// # Errors
/// [`Kind::Missing`], [`Kind::BadData`] for a table that is none, columns that are no flags, and cases of one name;
/// [`Kind::NothingToDo`] if there is no case.
pub fn read(path: &Path) -> Result<Vec<Case>> {
    let cases = if path.is_dir() { of_bids(path)? } else { of_table(path)? };
    let mut names = BTreeSet::new();
    if let Some(twice) = cases.iter().find(|case| !names.insert(&case.name)) {
        return Err(bad(path, format!("two cases have the name {:?}", twice.name))
            .help("give each a name of its own: column name"));
    }
    if cases.is_empty() {
        let (what, help) = match path.is_dir() {
            true => (
                "no scan with a mask in this folder",
                "BIDS' layout: sub-01/ct/sub-01_ct.nii.gz, and its mask derivatives/NAME/sub-01/ct/\
                 sub-01_label-bones_mask.nii.gz or a label map, ..._dseg.nii.gz",
            ),
            false => ("no rows in this table", "give a line for each case below the names of the columns"),
        };
        return Err(Error::new(Kind::NothingToDo, "VGS-CLI-181", what).file(path).help(help));
    }
    Ok(cases)
}

fn bad(path: &Path, message: String) -> Error {
    Error::new(Kind::BadData, "VGS-CLI-180", message)
        .file(path)
        .help("the first line names the columns: volume, and name, roi or any other flag of vgs fit without its dashes")
}

fn of_table(path: &Path) -> Result<Vec<Case>> {
    let failed = |e: csv::Error| match e.into_kind() {
        csv::ErrorKind::Io(e) => Error::io(path, "reading the cases", &e),
        csv::ErrorKind::UnequalLengths { pos, expected_len, len } => {
            let line = pos.map_or(0, |pos| pos.line());
            bad(path, format!("line {line} has {len} columns, and the first one {expected_len}"))
        }
        csv::ErrorKind::Utf8 { .. } => bad(path, "not text in UTF-8".to_owned()),
        other => bad(path, format!("no table: {other:?}")),
    };
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_path(path).map_err(failed)?;
    let head = reader.headers().map_err(failed)?.clone();
    let flags = command();
    let columns: Vec<Column<'_>> =
        head.iter().map(|name| Column::of(&flags, name, path)).collect::<Result<_>>()?;
    if !columns.iter().any(|column| matches!(column, Column::Volume)) {
        return Err(bad(path, "no column is called volume".to_owned()));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut cases = Vec::new();
    for record in reader.records() {
        let record = record.map_err(failed)?;
        let line = record.position().map_or(0, csv::Position::line);
        let (mut name, mut volume, mut arguments) = (None, None, Vec::new());
        for (column, cell) in columns.iter().zip(&record).filter(|(_, cell)| !cell.is_empty()) {
            match column {
                Column::Name => name = Some(cell.to_owned()),
                Column::Volume => volume = Some(folder.join(cell)),
                Column::Flag(arg) => flag(arg, cell, folder, &mut arguments)
                    .map_err(|what| bad(path, format!("line {line}: {what}")))?,
            }
        }
        let volume = volume.ok_or_else(|| bad(path, format!("line {line} names no volume")))?;
        let name = name.unwrap_or_else(|| stem(&volume));
        if name.is_empty() || name.starts_with('.') || name.contains(['/', '\\', '\0']) {
            return Err(bad(path, format!("line {line}: {name:?} cannot be the name of a file")));
        }
        arguments.push(volume.into());
        cases.push(Case { name, usual: Vec::new(), arguments });
    }
    Ok(cases)
}

/// What a column of a table holds.
enum Column<'a> {
    Name,
    Volume,
    Flag(&'a Arg),
}

impl<'a> Column<'a> {
    fn of(flags: &'a Command, name: &str, path: &Path) -> Result<Self> {
        let long = name.replace('_', "-");
        match long.as_str() {
            "name" => Ok(Column::Name),
            "volume" => Ok(Column::Volume),
            ours if OURS.contains(&ours) => Err(bad(
                path,
                format!("the column {name:?} is a flag of the batch, or none that it can have"),
            )
            .help(
                "leave it out; outputs are called as the case, and --force, --device are flags of vgs batch",
            )),
            _ => flags
                .get_arguments()
                .find(|arg| arg.get_long() == Some(&long))
                .map(Column::Flag)
                .ok_or_else(|| bad(path, format!("the column {name:?} is no flag of vgs fit"))),
        }
    }
}

/// Adds the flag of a cell; relative paths count from `folder`.
fn flag(
    arg: &Arg,
    cell: &str,
    folder: &Path,
    arguments: &mut Vec<OsString>,
) -> std::result::Result<(), String> {
    let long = arg.get_long().unwrap_or_default();
    if matches!(arg.get_action(), ArgAction::SetTrue) {
        match cell {
            "yes" | "true" | "1" => arguments.push(format!("--{long}").into()),
            "no" | "false" | "0" => {}
            other => return Err(format!("{long} is yes or no, not {other:?}")),
        }
        return Ok(());
    }
    let is_path = arg.get_value_parser().type_id() == TypeId::of::<PathBuf>();
    let value = if is_path { folder.join(cell).into_os_string() } else { OsString::from(cell) };
    let mut argument = OsString::from(format!("--{long}="));
    argument.push(value);
    arguments.push(argument);
    Ok(())
}

/// Returns the name of a volume's file without what says its format.
fn stem(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    name.rsplit_once('.').map_or(name, |(stem, _)| stem).to_owned()
}

/// The parts of a name in BIDS' layout: entities as `sub-01`, and the suffix.
fn parts(stem: &str) -> Option<(BTreeSet<&str>, &str)> {
    let (entities, suffix) = stem.rsplit_once('_')?;
    let entities: BTreeSet<&str> = entities.split('_').collect();
    entities.iter().any(|entity| entity.starts_with("sub-")).then_some((entities, suffix))
}

fn of_bids(root: &Path) -> Result<Vec<Case>> {
    let mut files = BTreeMap::new();
    find(root, &mut files)?;
    let is_mask = |stem: &str| parts(stem).is_some_and(|(_, suffix)| MASKS.contains(&suffix));
    let (masks, scans): (Vec<_>, Vec<_>) =
        files.iter().filter(|(_, stem)| parts(stem).is_some()).partition(|(_, stem)| is_mask(stem));
    let mut cases = Vec::new();
    for (scan, scan_stem) in scans {
        let Some((entities, _)) = parts(scan_stem) else { continue };
        for (mask, mask_stem) in &masks {
            if parts(mask_stem).is_some_and(|(all, _)| all.is_superset(&entities)) {
                let mut roi = OsString::from("--roi=");
                roi.push(mask);
                let is_labels = mask_stem.ends_with(LABELS);
                let usual = if is_labels { vec!["--roi-label=all".into()] } else { Vec::new() };
                cases.push(Case { name: (*mask_stem).clone(), usual, arguments: vec![roi, scan.into()] });
            }
        }
    }
    Ok(cases)
}

/// Adds the NIfTI files within a folder, with the stems of their names.
fn find(folder: &Path, files: &mut BTreeMap<PathBuf, String>) -> Result<()> {
    let failed = |e: std::io::Error| Error::io(folder, "listing the folder", &e);
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.file_type().map_err(failed)?.is_dir() {
            find(&path, files)?;
        } else if name.ends_with(".nii") || name.ends_with(".nii.gz") {
            files.insert(path.clone(), stem(&path));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<Vec<Case>> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("cases.csv");
        std::fs::write(&path, text).expect("a table");
        let cases = read(&path)?;
        let here = folder.path().to_string_lossy().into_owned() + "/";
        let text = |a: &OsString| OsString::from(a.to_string_lossy().replace(&here, ""));
        Ok(cases
            .into_iter()
            .map(|case| Case { arguments: case.arguments.iter().map(text).collect(), ..case })
            .collect())
    }

    #[test]
    fn columns_are_flags_and_paths_count_from_the_table() {
        let text = "volume,roi,name,quality,no-eval,roi_threshold\n\
                    # a comment\n\
                    a/ct.nii.gz,a/bones.nii.gz,,fine,yes,\n\
                    /b/ct.nrrd, ,second case,,no,\"-100,300\"\n";
        let cases = table(text).expect("cases");
        assert_eq!(cases[0].name, "ct");
        assert_eq!(
            cases[0].arguments,
            ["--roi=a/bones.nii.gz", "--quality=fine", "--no-eval", "a/ct.nii.gz"]
        );
        assert_eq!(cases[1].name, "second case");
        assert_eq!(cases[1].arguments, ["--roi-threshold=-100,300", "/b/ct.nrrd"]);
    }

    #[test]
    fn what_is_no_table_of_cases_is_refused_by_name() {
        for (text, word, code) in [
            ("", "no column is called volume", "VGS-CLI-180"),
            ("volume\n", "no rows", "VGS-CLI-181"),
            ("roi\na.nii\n", "called volume", "VGS-CLI-180"),
            ("volume,colour\na,b\n", "\"colour\" is no flag", "VGS-CLI-180"),
            ("volume,output\na,b\n", "\"output\"", "VGS-CLI-180"),
            ("volume,roi\na.nii\n", "line 2 has 1 columns", "VGS-CLI-180"),
            ("volume,roi\n,b.nii\n", "line 2 names no volume", "VGS-CLI-180"),
            ("volume\na/x.nii\nb/x.nii\n", "the name \"x\"", "VGS-CLI-180"),
            ("volume,name\na,../b\n", "cannot be the name of a file", "VGS-CLI-180"),
            ("volume,no-eval\na,perhaps\n", "yes or no", "VGS-CLI-180"),
        ] {
            let error = table(text).expect_err(text);
            assert!(error.code == code && error.message.contains(word), "{text:?}: {error}");
        }
    }

    #[test]
    fn a_folder_of_bids_has_a_case_for_each_mask_of_a_scan() {
        let folder = tempfile::tempdir().expect("a folder");
        let touch = |path: &str| {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            std::fs::write(path, "").expect("a file");
        };
        let files = [
            "sub-01/ct/sub-01_ct.nii.gz",
            "sub-02/ses-1/ct/sub-02_ses-1_ct.nii",
            "sub-02/ses-2/ct/sub-02_ses-2_ct.nii",
            "sub-03/ct/sub-03_ct.nii.gz",
            "derivatives/total/sub-01/ct/sub-01_label-bones_mask.nii.gz",
            "derivatives/total/sub-01/ct/sub-01_dseg.nii.gz",
            "derivatives/total/sub-02/sub-02_ses-2_dseg.nii.gz",
            "participants.tsv",
            "other.nii",
        ];
        files.iter().for_each(|path| touch(path));
        let cases = read(folder.path()).expect("cases");
        let names: Vec<&str> = cases.iter().map(|case| case.name.as_str()).collect();
        assert_eq!(names, ["sub-01_dseg", "sub-01_label-bones_mask", "sub-02_ses-2_dseg"]);
        assert!(cases[2].arguments[1].to_string_lossy().ends_with("sub-02_ses-2_ct.nii"), "its own session");
        let usual: Vec<usize> = cases.iter().map(|case| case.usual.len()).collect();
        assert_eq!(usual, [1, 0, 1], "all labels of a label map, where none are chosen");
        let empty = tempfile::tempdir().expect("a folder");
        assert_eq!(read(empty.path()).expect_err("nothing").code, "VGS-CLI-181");
    }
}
