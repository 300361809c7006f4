//! Results of runs as files, one each: what is there is not run again.

use std::fs;
use std::path::{Path, PathBuf};

use engine::{Error, Kind, Result, output};

use super::job::Job;
use super::runs::Record;

/// The folder of results.
pub struct Store {
    folder: PathBuf,
}

impl Store {
    /// In this folder, which is made if it is missing.
    pub fn open(folder: &Path) -> Result<Self> {
        let store = Store { folder: folder.to_owned() };
        fs::create_dir_all(store.runs()).map_err(|e| Error::io(folder, "making the folder", &e))?;
        Ok(store)
    }

    fn runs(&self) -> PathBuf {
        self.folder.join("runs")
    }

    /// A file of the folder that is not a run.
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn path(&self, job: &Job) -> PathBuf {
        self.runs().join(format!("{}.json", job.key()))
    }

    /// The result of a job, if there is one.
    ///
    /// # Errors
    /// [`Kind::BadData`] if the file is no result, or that of another job.
    pub fn load(&self, job: &Job) -> Result<Option<Record>> {
        let path = self.path(job);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::io(&path, "reading", &e)),
        };
        let bad = |message: String| {
            Err(Error::new(Kind::BadData, "VGS-BEN-001", message)
                .file(&path)
                .help("delete the file, or repeat all runs with --force"))
        };
        match serde_json::from_str::<Record>(&text) {
            Err(e) => bad(format!("this is not the result of a run: {e}")),
            Ok(record) if record.job != *job => bad("this is the result of another run".into()),
            Ok(record) if record.points.is_empty() => bad("this result has no measurement".into()),
            Ok(record) => Ok(Some(record)),
        }
    }

    /// Keeps a result, whole or not at all.
    pub fn save(&self, record: &Record) -> Result<()> {
        output::write_atomic(self.path(&record.job), true, |w| {
            serde_json::to_writer_pretty(w, record).map_err(Into::into)
        })
    }

    /// Writes a report beside the results, in place of an older one.
    pub fn report(&self, name: &str, text: &str) -> Result<()> {
        output::write_atomic(self.file(name), true, |w| w.write_all(text.as_bytes()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::job::tests::job;
    use crate::paper::runs::tests::record;

    #[test]
    fn a_result_comes_back_and_only_for_its_own_job() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(&folder.path().join("a/b")).expect("a store");
        assert!(store.load(&job(5)).expect("no error").is_none());
        let kept = record(job(5), &[0.0123, 0.25]);
        store.save(&kept).expect("written");
        let again = Store::open(&folder.path().join("a/b")).expect("the same store");
        assert_eq!(again.load(&job(5)).expect("a result"), Some(kept));
        assert!(store.load(&job(6)).expect("no error").is_none(), "another setting is another run");
    }

    #[test]
    fn what_is_no_result_is_refused_by_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).expect("a store");
        let other = serde_json::to_string(&record(job(6), &[0.1])).expect("json");
        let empty = serde_json::to_string(&record(job(5), &[])).expect("json");
        for (text, says) in
            [("{", "not the result"), (other.as_str(), "another run"), (empty.as_str(), "no measurement")]
        {
            fs::write(store.path(&job(5)), text).expect("written");
            let error = store.load(&job(5)).expect_err(says);
            assert!(error.message.contains(says) && error.file.is_some(), "{error}");
        }
    }
}
