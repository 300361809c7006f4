//! The fuzzer: libFuzzer looks for files that lead a reader where none has led it. `tools/fuzz` builds and starts it.
//!
//! Its options are libFuzzer's, besides `--list`, `--reader=NAME`, `--faults=DIR` and `--replay=FILE`. The first
//! argument without a dash is the folder of the files that it begins with and adds to.
#![forbid(unsafe_code)]
#![no_main]

use std::fs;
use std::path::Path;
use std::process::exit;
use std::sync::{Mutex, OnceLock};

use fuzz::mutate::mutated;
use fuzz::targets::TARGETS;
use fuzz::trial::{Fault, Trial, is_alike};
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

/// The reader under trial.
static TRIAL: OnceLock<Trial> = OnceLock::new();
/// Its valid files.
static VALID: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
/// What it did that it must not do.
static FAULTS: Mutex<Vec<Fault>> = Mutex::new(Vec::new());

fuzz_target!(init: begin(), |bytes: &[u8]| {
    try_file(bytes);
});

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    let valid = VALID.get_or_init(|| (TRIAL.get().expect("a reader").target.seeds)());
    let made = mutated(seed, &data[..size], valid, max_size, fuzzer_mutate);
    data[..made.len()].copy_from_slice(&made);
    made.len()
});

fn option(name: &str) -> Option<String> {
    std::env::args().find_map(|argument| Some(argument.strip_prefix(name)?.to_owned()))
}

/// Does what was asked for, or prepares the trials of a reader, with its valid files and those that led to faults once.
fn begin() {
    if option("--list").is_some() {
        TARGETS.iter().for_each(|target| println!("{}", target.name));
        exit(0);
    }
    let name = option("--reader=").unwrap_or_default();
    let target = TARGETS.iter().find(|target| target.name == name).expect("a reader of the list");
    let trial = TRIAL.get_or_init(|| Trial::new(target).expect("a place for files"));
    if let Some(path) = option("--replay=") {
        let bytes = fs::read(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
        // What libFuzzer keeps is not mended yet.
        let read = trial.read(&bytes).and_then(|_| trial.read(&(target.mend)(&bytes)));
        println!("{path}: {read:?}");
        exit(read.is_err().into());
    }
    if let Some(folder) = std::env::args().skip(1).find(|argument| !argument.starts_with('-')) {
        let known = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target.name);
        let known = fs::read_dir(known).into_iter().flatten();
        let known = known.filter_map(|file| fs::read(file.ok()?.path()).ok());
        for (number, file) in (target.seeds)().into_iter().chain(known).enumerate() {
            fs::write(Path::new(&folder).join(format!("seed-{number}")), file).expect("a folder of files");
        }
    }
}

/// Reads a file, and keeps it if it leads to a fault of a new kind or place.
fn try_file(bytes: &[u8]) {
    let trial = TRIAL.get().expect("a reader");
    let target = trial.target;
    let bytes = (target.mend)(bytes);
    let Err(fault) = trial.read(&bytes) else { return };
    let mut faults = FAULTS.lock().expect("one thread");
    if !faults.iter().any(|known| is_alike(known, &fault)) {
        let bytes = trial.minimized(bytes, &fault);
        let name = format!("{}-{:08x}.{}", target.name, fuzz::crc(&bytes), target.extension);
        let file = Path::new(&option("--faults=").unwrap_or_default()).join(name);
        fs::write(&file, bytes).expect("a folder of faults");
        println!("{}: {fault:?}", file.display());
        faults.push(fault);
    }
}
