//! No reader panics, or takes more memory or time than its bound, for files that are valid, that led to a fault once,
//! or that are mutated.

use std::path::Path;
use std::time::Duration;

use fuzz::targets::TARGETS;
use fuzz::trial::Trial;

/// Mutated files of each reader.
const FILES: u64 = 2000;

#[test]
fn readers_survive_what_they_are_given() {
    for target in TARGETS {
        let trial = Trial::new(target).expect("a place for files");
        for (number, seed) in (target.seeds)().iter().enumerate() {
            assert_eq!(trial.read(seed), Ok(true), "{}: seed {number} is valid", target.name);
        }
        let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target.name);
        for file in std::fs::read_dir(corpus).into_iter().flatten() {
            let path = file.expect("an entry").path();
            let read = trial.read(&std::fs::read(&path).expect("a file"));
            assert!(read.is_ok(), "{}: {read:?}", path.display());
        }
        let outcome = trial.series(1, FILES, Duration::from_secs(120), |_, _| ());
        let faults: Vec<_> = outcome.faults.iter().map(|(fault, _)| fault).collect();
        assert!(faults.is_empty(), "{}: {faults:?}", target.name);
        assert_eq!(outcome.executions, FILES, "{}", target.name);
        assert!(outcome.accepted < FILES, "{}: mutations break something", target.name);
    }
}
