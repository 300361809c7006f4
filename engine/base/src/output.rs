//! Output files that appear whole or not at all.
//!
//! A file is written under a temporary name in its own folder, flushed, synced and renamed: a crash, a full
//! disk or a signal leaves either the old content or the new, never half of one, and no temporary file after
//! an error. What a killed run left behind is removed by the next one that asks for an output in that folder.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use tempfile::{Builder, NamedTempFile};

use crate::{Error, Kind, Result};

/// Writes `path` through `write`, atomically. An existing file is refused unless `force` is set.
///
/// With `force` a symbolic link at `path` is itself replaced by the new file; what it pointed to stays as it
/// was. The content is buffered here, so `write` may issue small writes; errors of the final flush are
/// reported.
///
/// # Errors
/// [`Kind::CannotCreate`] where [`check_writable`] gives it, [`Kind::Io`] when writing fails (as on a full
/// disk).
pub fn write_atomic(
    path: impl AsRef<Path>,
    force: bool,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<()> {
    let path = path.as_ref();
    check_target(path, force)?;
    let temporary = temporary_beside(path)?;
    let failed = |e: &io::Error| {
        Error::new(Kind::Io, "VGS-OUT-006", format!("writing failed: {e}"))
            .file(path)
            .help("free some space or choose another folder; this file is as it was")
    };
    {
        let mut buffered = BufWriter::with_capacity(1 << 20, temporary.as_file());
        write(&mut buffered).and_then(|()| buffered.flush()).map_err(|e| failed(&e))?;
    }
    temporary.as_file().sync_all().map_err(|e| failed(&e))?;
    // Without `force` the rename itself refuses a file that another process made in the meantime.
    let persisted = if force { temporary.persist(path) } else { temporary.persist_noclobber(path) };
    persisted.map_err(|e| match e.error.kind() {
        io::ErrorKind::AlreadyExists => exists(path),
        _ => failed(&e.error),
    })?;
    sync_folder(&folder_of(path)).map_err(|e| failed(&e))
}

/// Writes the folder `path` through `write`, which gets an empty folder: `path` appears whole or not at all. What exists is
/// refused unless `force` is set and `replaced` says that it is a folder of the same kind.
///
/// # Errors
/// As [`write_atomic`], and those of `write`.
pub fn write_folder(
    path: impl AsRef<Path>,
    force: bool,
    replaced: fn(&Path) -> bool,
    write: impl FnOnce(&Path) -> Result<()>,
) -> Result<()> {
    let path = path.as_ref();
    check_folder(path, force, replaced)?;
    let beside = folder_of(path);
    let failed =
        |e: &io::Error| Error::new(Kind::Io, "VGS-OUT-006", format!("writing failed: {e}")).file(path);
    let work = Builder::new().prefix(TEMPORARY.0).tempdir_in(&beside).map_err(|e| failed(&e))?;
    let (new, old) = (work.path().join("new"), work.path().join("old"));
    fs::create_dir(&new).map_err(|e| failed(&e))?;
    write(&new)?;
    if path.exists() {
        fs::rename(path, &old).map_err(|e| failed(&e))?;
    }
    fs::rename(&new, path).map_err(|e| {
        // The old one comes back where the new one cannot go.
        let _ = fs::rename(&old, path);
        failed(&e)
    })?;
    sync_folder(&beside).map_err(|e| failed(&e))
}

/// Checks that [`write_folder`] could write `path`.
///
/// # Errors
/// As [`check_writable`].
pub fn check_folder(path: impl AsRef<Path>, force: bool, replaced: fn(&Path) -> bool) -> Result<()> {
    let path = path.as_ref();
    match fs::symlink_metadata(path) {
        Ok(found) if found.is_dir() && replaced(path) => {
            if !force {
                return Err(exists(path));
            }
        }
        _ => check_target(path, false)?,
    }
    temporary_beside(path).map(drop)
}

/// Returns the number of bytes that `write` writes.
pub fn counted(write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> u64 {
    let mut count = Count(0);
    // Counting cannot fail.
    let _ = write(&mut count);
    count.0
}

/// A sink that counts bytes and drops them.
struct Count(u64);

impl Write for Count {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Checks that [`write_atomic`] could write `path`, so that a program can ask before it computes anything.
/// Also removes temporary files that killed runs left in the folder.
///
/// # Errors
/// [`Kind::CannotCreate`] if `path` exists and `force` is not set, if it is a folder or a device, or if its
/// folder is missing, is no folder or cannot be written to.
pub fn check_writable(path: impl AsRef<Path>, force: bool) -> Result<()> {
    let path = path.as_ref();
    check_target(path, force)?;
    remove_abandoned(&folder_of(path));
    // Permission bits say little (ACLs, read-only mounts, root): only a file that was made proves the folder.
    temporary_beside(path).map(drop)
}

/// Returns true if two paths name one file, also through hard or symbolic links; false if either does not
/// exist.
pub fn same_file(a: impl AsRef<Path>, b: impl AsRef<Path>) -> bool {
    let (Ok(a), Ok(b)) = (fs::canonicalize(a), fs::canonicalize(b)) else { return false };
    a == b || same_inode(&a, &b)
}

#[cfg(unix)]
fn same_inode(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (fs::metadata(a), fs::metadata(b)) {
        (Ok(a), Ok(b)) => a.dev() == b.dev() && a.ino() == b.ino(),
        _ => false,
    }
}

#[cfg(not(unix))]
fn same_inode(_: &Path, _: &Path) -> bool {
    false
}

fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

fn exists(path: &Path) -> Error {
    Error::new(Kind::CannotCreate, "VGS-OUT-001", "the output exists already")
        .file(path)
        .help("choose another name, or replace it with --force")
}

fn check_target(path: &Path, force: bool) -> Result<()> {
    if path.file_name().is_none() {
        return Err(Error::new(Kind::CannotCreate, "VGS-OUT-002", "the output has no file name").file(path));
    }
    // The link itself, not what it points to: a dangling link occupies the name as well.
    if let Ok(meta) = fs::symlink_metadata(path) {
        if !meta.is_file() && !meta.is_symlink() {
            let what = if meta.is_dir() { "a folder" } else { "not a regular file" };
            let message = format!("the output is {what}");
            return Err(Error::new(Kind::CannotCreate, "VGS-OUT-003", message).file(path));
        }
        if !force {
            return Err(exists(path));
        }
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        let message = format!("the folder {} does not exist or is not a folder", folder.display());
        return Err(Error::new(Kind::CannotCreate, "VGS-OUT-004", message)
            .file(path)
            .help("create the folder first"));
    }
    Ok(())
}

/// Beginning and end of the names of temporary files, and the number of letters and digits between them.
const TEMPORARY: (&str, &str, usize) = (".vgs-", ".tmp", 6);

/// The longest time between creating a temporary file and locking it. An older file that nobody has locked is
/// abandoned.
const UNLOCKED: Duration = Duration::from_secs(60);

/// Removes temporary files of runs that were killed: their locks went with the processes. Leaves files that
/// it cannot examine.
fn remove_abandoned(folder: &Path) {
    let (prefix, suffix, letters) = TEMPORARY;
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let inner = name.to_str().and_then(|n| n.strip_prefix(prefix)).and_then(|n| n.strip_suffix(suffix));
        if !inner.is_some_and(|n| n.len() == letters && n.bytes().all(|b| b.is_ascii_alphanumeric())) {
            continue;
        }
        // For a link this is the metadata of the link itself: it is not a file, so it is left alone.
        let Ok(meta) = entry.metadata() else { continue };
        let age = meta.modified().ok().and_then(|at| at.elapsed().ok()).unwrap_or_default();
        if !meta.is_file() || age < UNLOCKED {
            continue;
        }
        let Ok(file) = File::open(entry.path()) else { continue };
        if file.try_lock().is_ok() {
            let _ = fs::remove_file(entry.path());
        }
    }
}

fn temporary_beside(path: &Path) -> Result<NamedTempFile> {
    let folder = folder_of(path);
    let (prefix, suffix, letters) = TEMPORARY;
    let mut builder = Builder::new();
    // The name does not grow with the target's, which may already be as long as the file system allows.
    builder.prefix(prefix).suffix(suffix).rand_bytes(letters);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The rename keeps the mode, so the file is made as any other output is: 0666 less the umask.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let made = builder.tempfile_in(&folder).inspect(|temporary| {
        // On a file system without locks nothing is ever taken for abandoned.
        let _ = temporary.as_file().try_lock();
    });
    made.map_err(|e| {
        let message = format!("cannot create a file in {}: {e}", folder.display());
        match e.kind() {
            io::ErrorKind::StorageFull => Error::new(Kind::Io, "VGS-OUT-006", message).file(path),
            _ => Error::new(Kind::CannotCreate, "VGS-OUT-005", message)
                .file(path)
                .help("choose a folder that you may write to"),
        }
    })
}

/// Makes the rename itself durable by syncing `folder`. Does nothing on platforms that cannot open a folder.
fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn put(path: &Path, force: bool, text: &[u8]) -> Result<()> {
        write_atomic(path, force, |w| w.write_all(text))
    }

    #[test]
    fn an_existing_output_needs_force() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        check_writable(&path, false).unwrap();
        assert!(names(dir.path()).is_empty(), "the check leaves nothing behind");
        put(&path, false, b"one").unwrap();
        for error in [check_writable(&path, false).unwrap_err(), put(&path, false, b"two").unwrap_err()] {
            assert_eq!((error.kind, error.code), (Kind::CannotCreate, "VGS-OUT-001"));
            assert!(error.help.contains("--force"));
        }
        assert_eq!(fs::read(&path).unwrap(), b"one");
        check_writable(&path, true).unwrap();
        put(&path, true, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
        assert_eq!(names(dir.path()), ["a.txt"]);
    }

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        put(&path, false, b"old").unwrap();
        let error = write_atomic(&path, true, |w| {
            w.write_all(&[0; 4096])?;
            Err(io::ErrorKind::StorageFull.into())
        })
        .unwrap_err();
        assert_eq!(error.kind, Kind::Io);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(dir.path()), ["a.txt"]);
    }

    #[test]
    fn a_folder_appears_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.zarr");
        let is_ours: fn(&Path) -> bool = |path| path.join("mark").is_file();
        let put = |force, text: &str, ends: Result<()>| {
            write_folder(&path, force, is_ours, |folder| {
                fs::write(folder.join("mark"), text).unwrap();
                ends
            })
        };
        put(false, "one", Ok(())).unwrap();
        assert_eq!(put(false, "two", Ok(())).unwrap_err().code, "VGS-OUT-001");
        put(true, "two", Err(Error::new(Kind::Io, "VGS-OUT-006", "full"))).unwrap_err();
        assert_eq!(fs::read(path.join("mark")).unwrap(), b"one", "a failed write keeps the old folder");
        fs::write(path.join("more"), "").unwrap();
        put(true, "two", Ok(())).unwrap();
        assert_eq!((names(&path), names(dir.path())), (vec!["mark".into()], vec!["a.zarr".into()]));
        assert_eq!(fs::read(path.join("mark")).unwrap(), b"two");
        // A folder of another kind stays, also with force.
        fs::remove_file(path.join("mark")).unwrap();
        fs::write(path.join("thesis.txt"), "").unwrap();
        assert_eq!(put(true, "two", Ok(())).unwrap_err().code, "VGS-OUT-003");
        assert_eq!(names(&path), ["thesis.txt"]);
    }

    #[test]
    fn what_a_killed_run_left_is_removed_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let put = |name: &str, seconds: u64| {
            let file = File::create(dir.path().join(name)).unwrap();
            file.set_modified(std::time::SystemTime::now() - Duration::from_secs(seconds)).unwrap();
            file
        };
        put(".vgs-a1B2c3.tmp", 3600);
        let locked = put(".vgs-locked.tmp", 3600);
        locked.lock().unwrap();
        for (name, age) in [(".vgs-young1.tmp", 1), (".vgs-longer7.tmp", 3600), (".vgs-a.1B2.tmp", 3600)] {
            put(name, age);
        }
        put("vgs-a1B2c3.tmp", 3600);
        check_writable(dir.path().join("a.txt"), false).unwrap();
        let left =
            [".vgs-a.1B2.tmp", ".vgs-locked.tmp", ".vgs-longer7.tmp", ".vgs-young1.tmp", "vgs-a1B2c3.tmp"];
        assert_eq!(names(dir.path()), left);
        drop(locked);
        check_writable(dir.path().join("a.txt"), false).unwrap();
        assert!(!names(dir.path()).contains(&left[1].to_owned()), "its process is gone");
    }

    #[test]
    fn places_that_cannot_hold_an_output() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("file");
        fs::write(&file, b"x").unwrap();
        fs::create_dir(dir.path().join("folder")).unwrap();
        let mut cases =
            vec![("missing/a.txt", "VGS-OUT-004"), ("file/a.txt", "VGS-OUT-004"), ("folder", "VGS-OUT-003")];
        cases.push(("..", "VGS-OUT-002"));
        if cfg!(target_os = "linux") {
            // Nobody may make files there, and writing to a device would not replace it.
            cases.extend([("/sys/a.txt", "VGS-OUT-005"), ("/dev/full", "VGS-OUT-003")]);
        }
        for (name, code) in cases {
            for error in [
                check_writable(dir.path().join(name), true).unwrap_err(),
                put(&dir.path().join(name), true, b"x").unwrap_err(),
            ] {
                assert_eq!((error.kind, error.code), (Kind::CannotCreate, code), "{name}");
            }
        }
        assert_eq!(names(dir.path()), ["file", "folder"]);
    }

    #[cfg(unix)]
    #[test]
    fn force_replaces_a_link_and_not_its_target() {
        let dir = tempfile::tempdir().unwrap();
        let (target, link) = (dir.path().join("target"), dir.path().join("link"));
        fs::write(&target, b"precious").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        assert_eq!(put(&link, false, b"new").unwrap_err().code, "VGS-OUT-001");
        put(&link, true, b"new").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"precious");
        assert!(!fs::symlink_metadata(&link).unwrap().is_symlink());
    }

    #[cfg(unix)]
    #[test]
    fn one_file_under_several_names() {
        let dir = tempfile::tempdir().unwrap();
        let path = |n: &str| dir.path().join(n);
        fs::write(path("a"), b"x").unwrap();
        fs::write(path("b"), b"x").unwrap();
        fs::hard_link(path("a"), path("hard")).unwrap();
        std::os::unix::fs::symlink(path("a"), path("soft")).unwrap();
        for (name, same) in
            [("a", true), ("hard", true), ("soft", true), ("./a", true), ("b", false), ("none", false)]
        {
            assert_eq!(same_file(path("a"), path(name)), same, "{name}");
        }
    }
}
