//! No reader panics, or takes more memory or time than its bound, for files that are valid, that led to a fault once,
//! or that are valid but for one change. `tools/fuzz` looks for more.

use std::path::Path;

use fuzz::targets::TARGETS;
use fuzz::trial::Trial;

/// Cut and changed files of each valid one.
const FILES: usize = 400;

#[test]
fn readers_survive_what_they_are_given() {
    for target in TARGETS {
        let trial = Trial::new(target).expect("a place for files");
        let mut refused = 0;
        for (number, seed) in (target.seeds)().iter().enumerate() {
            assert_eq!(trial.read(seed), Ok(true), "{}: seed {number} is valid", target.name);
            for i in 0..FILES {
                let at = i * seed.len() / FILES;
                let mut changed = seed.clone();
                match i % 4 {
                    0 => changed.truncate(at),
                    1 => changed[at] = !changed[at],
                    _ => changed[at] ^= 1 << (i % 8),
                }
                let read = trial.read(&(target.mend)(&changed));
                refused += usize::from(read == Ok(false));
                assert!(read.is_ok(), "{}: seed {number}, change {i}: {read:?}", target.name);
            }
        }
        assert!(refused > 0, "{}: changes break something", target.name);
        let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target.name);
        for file in std::fs::read_dir(corpus).into_iter().flatten() {
            let path = file.expect("an entry").path();
            let read = trial.read(&std::fs::read(&path).expect("a file"));
            assert!(read.is_ok(), "{}: {read:?}", path.display());
        }
    }
}
