//! What several runs have read, so that they add up: a line of text for each series of files.
//!
//! A series is the files that follow from one seed, from the first on. A run that goes on takes the next seed that the
//! reader has no series of, so no file is counted twice.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use engine::{Error, Kind, Result};

use crate::trial::Outcome;

/// A file of series.
pub struct Log {
    path: PathBuf,
    /// The series, in the order in which they ended.
    pub series: Vec<Series>,
}

/// What came of the files of one seed, or of several together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name of the reader.
    pub reader: String,
    /// Seed; of several the last one.
    pub seed: u64,
    /// Files read.
    pub files: u64,
    /// Files that were accepted.
    pub accepted: u64,
    /// Different faults.
    pub faults: u64,
    /// Most bytes of the heap that a file took.
    pub peak_bytes: u64,
    /// Time of the processor.
    pub time: Duration,
}

impl Series {
    /// Returns what came of a reader's files of a seed.
    pub fn of(reader: &str, seed: u64, outcome: &Outcome) -> Self {
        Series {
            reader: reader.to_owned(),
            seed,
            files: outcome.executions,
            accepted: outcome.accepted,
            faults: outcome.faults.len() as u64,
            peak_bytes: outcome.peak_bytes as u64,
            time: outcome.time,
        }
    }

    /// Parses a line; `None` if it is none.
    fn parse(line: &str) -> Option<Self> {
        let [reader, numbers @ ..] = &line.split('\t').collect::<Vec<_>>()[..] else { return None };
        let numbers: Vec<u64> = numbers.iter().map(|n| n.parse().ok()).collect::<Option<_>>()?;
        let &[seed, files, accepted, faults, peak_bytes, ms] = &numbers[..] else { return None };
        let time = Duration::from_millis(ms);
        Some(Series { reader: (*reader).to_owned(), seed, files, accepted, faults, peak_bytes, time })
    }

    fn line(&self) -> String {
        let Series { reader, seed, files, accepted, faults, peak_bytes, time } = self;
        format!("{reader}\t{seed}\t{files}\t{accepted}\t{faults}\t{peak_bytes}\t{}\n", time.as_millis())
    }

    /// Returns this as a row of a table in Markdown, whose head is [`HEAD`].
    pub fn row(&self) -> String {
        let files = self.files.max(1) as f64;
        format!(
            "| {} | {} | {:.0} % | {:.0} | {:.1} | {} |",
            self.reader,
            self.files,
            100.0 * self.accepted as f64 / files,
            self.files as f64 / self.time.as_secs_f64().max(1e-3),
            self.peak_bytes as f64 / 1e6,
            self.faults
        )
    }
}

/// Head of the table of [`Series::row`]: the rate is of a second of the processor.
pub const HEAD: &str =
    "| reader | files | accepted | a second | most heap, MB | faults |\n|---|---|---|---|---|---|";

impl Log {
    /// Opens a log, which need not be there yet.
    ///
    /// # Errors
    /// [`Kind::BadData`] if the file is no log; [`Kind::Io`].
    pub fn open(path: &Path) -> Result<Self> {
        let mut series = Vec::new();
        if path.exists() {
            let file = File::open(path).map_err(|e| Error::io(path, "reading a log", &e))?;
            for (number, line) in BufReader::new(file).lines().enumerate() {
                let line = line.map_err(|e| Error::io(path, "reading a log", &e))?;
                series.push(Series::parse(&line).ok_or_else(|| {
                    let message = format!("line {} is no series of the fuzzer", number + 1);
                    Error::new(Kind::BadData, "VGS-FUZ-003", message).file(path).help("name another file")
                })?);
            }
        }
        Ok(Log { path: path.to_owned(), series })
    }

    /// Adds a series, to the file as well.
    ///
    /// # Errors
    /// [`Kind::Io`].
    pub fn add(&mut self, series: Series) -> Result<()> {
        let file = OpenOptions::new().create(true).append(true).open(&self.path);
        // A line is written at once, so that several programs may write to one log.
        file.and_then(|mut file| file.write_all(series.line().as_bytes()))
            .map_err(|e| Error::io(&self.path, "writing a log", &e))?;
        self.series.push(series);
        Ok(())
    }

    /// Returns the sum of all series of a reader.
    pub fn total(&self, reader: &str) -> Series {
        let mut total = Series { reader: reader.to_owned(), ..Series::default() };
        for series in self.series.iter().filter(|series| series.reader == reader) {
            total.seed = total.seed.max(series.seed);
            total.files += series.files;
            total.accepted += series.accepted;
            total.faults += series.faults;
            total.peak_bytes = total.peak_bytes.max(series.peak_bytes);
            total.time += series.time;
        }
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_add_up_over_runs() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("log");
        let series = |reader: &str, seed: u64, files: u64| Series {
            reader: reader.into(),
            seed,
            files,
            accepted: files / 4,
            faults: seed - 1,
            peak_bytes: 1000 * seed,
            time: Duration::from_millis(files),
        };
        for row in [series("ply", 1, 100), series("nifti", 1, 7), series("ply", 2, 50)] {
            Log::open(&path).expect("a log").add(row).expect("writing");
        }
        let total = Log::open(&path).expect("a log").total("ply");
        let expected =
            Series { accepted: 37, faults: 1, time: Duration::from_millis(150), ..series("ply", 2, 150) };
        assert_eq!(total, expected);
        assert_eq!(total.row(), "| ply | 150 | 25 % | 1000 | 0.0 | 1 |");
        assert_eq!(Log::open(&path).expect("a log").total("npy").files, 0);
        std::fs::write(&path, "ply\t1\t2\n").expect("writing");
        assert_eq!(Log::open(&path).err().expect("no log").code, "VGS-FUZ-003");
    }
}
