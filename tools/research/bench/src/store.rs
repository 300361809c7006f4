//! Keeps results as files, one for each key, so that nothing is measured twice.

use std::fs;
use std::path::{Path, PathBuf};

use engine::{Error, Kind, Result, output};
use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

/// Result that a store can keep.
pub trait Keep: Serialize + DeserializeOwned {
    /// Returns the name of the result's file without its extension: a readable part, then a [`hash`] of
    /// everything that it depends on.
    fn key(&self) -> String;

    /// Returns the reason why this is no valid result, or `None`.
    fn defect(&self) -> Option<&'static str> {
        None
    }
}

/// Returns a hash of a value's JSON, 10 hexadecimal digits.
pub fn hash(value: &impl Serialize) -> String {
    hash_bytes(serde_json::to_string(value).expect("only numbers and names").as_bytes())
}

/// Returns a hash of bytes, 10 hexadecimal digits.
pub fn hash_bytes(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().take(5).map(|b| format!("{b:02x}")).collect()
}

/// Folder of results, with reports beside them.
pub struct Store {
    folder: PathBuf,
}

impl Store {
    /// Opens a store in `folder`, which is created if it is missing.
    pub fn open(folder: &Path) -> Result<Self> {
        let store = Store { folder: folder.to_owned() };
        fs::create_dir_all(store.runs()).map_err(|e| Error::io(folder, "making the folder", &e))?;
        Ok(store)
    }

    fn runs(&self) -> PathBuf {
        self.folder.join("runs")
    }

    /// Returns the path of a file of the folder that is no result.
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn path(&self, key: &str) -> PathBuf {
        self.runs().join(format!("{key}.json"))
    }

    /// Reads the result with this key, if there is one.
    ///
    /// # Errors
    /// Returns [`Kind::BadData`] if the file is no result, or the result of another key.
    pub fn load<R: Keep>(&self, key: &str) -> Result<Option<R>> {
        let path = self.path(key);
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::io(&path, "reading", &e)),
        };
        let bad = |message: String| {
            Err(Error::new(Kind::BadData, "VGS-BEN-001", message)
                .file(&path)
                .help("delete the file, or measure all of it again with --force"))
        };
        match serde_json::from_str::<R>(&text) {
            Err(e) => bad(format!("this is no result: {e}")),
            Ok(result) if result.key() != key => bad(format!("this is the result of {}", result.key())),
            Ok(result) => match result.defect() {
                Some(why) => bad(why.into()),
                None => Ok(Some(result)),
            },
        }
    }

    /// Writes a result, whole or not at all.
    pub fn save<R: Keep>(&self, result: &R) -> Result<()> {
        output::write_atomic(self.path(&result.key()), true, |w| {
            serde_json::to_writer_pretty(w, result).map_err(Into::into)
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

    /// A result with a number of splats.
    #[derive(Clone, Debug, PartialEq, Serialize, serde::Deserialize)]
    struct Counted {
        splats: usize,
        errors: Vec<f64>,
    }

    impl Keep for Counted {
        fn key(&self) -> String {
            format!("{}-{}", self.splats, hash(&self.splats))
        }

        fn defect(&self) -> Option<&'static str> {
            self.errors.is_empty().then_some("there is no measurement in it")
        }
    }

    fn counted(splats: usize, errors: &[f64]) -> Counted {
        Counted { splats, errors: errors.to_vec() }
    }

    #[test]
    fn a_result_comes_back_and_only_by_its_own_key() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(&folder.path().join("a/b")).expect("a store");
        let load = |store: &Store, splats: usize| store.load::<Counted>(&counted(splats, &[]).key());
        assert!(load(&store, 5).expect("no error").is_none());
        let kept = counted(5, &[0.0123, 0.25]);
        store.save(&kept).expect("written");
        let again = Store::open(&folder.path().join("a/b")).expect("the same store");
        assert_eq!(load(&again, 5).expect("a result"), Some(kept));
        assert!(load(&store, 6).expect("no error").is_none(), "another setting is another run");
    }

    #[test]
    fn what_is_no_result_is_refused_by_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).expect("a store");
        let key = counted(5, &[]).key();
        let other = serde_json::to_string(&counted(6, &[0.1])).expect("json");
        let empty = serde_json::to_string(&counted(5, &[])).expect("json");
        for (text, says) in
            [("{", "no result"), (other.as_str(), "the result of"), (empty.as_str(), "no measurement")]
        {
            fs::write(store.path(&key), text).expect("written");
            let error = store.load::<Counted>(&key).expect_err(says);
            assert!(error.message.contains(says) && error.file.is_some(), "{error}");
        }
    }
}
