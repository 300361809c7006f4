//! What the rows of both tables name: files of tests, and tests that are tables themselves.

use super::{Test, t};

pub const NIFTI: &str = "engine/volume/src/nifti/tests.rs";
pub const ROI: &str = "engine/volume/src/roi.rs";
pub const PLY: &str = "engine/splat/src/ply/tests/mod.rs";
pub const FIT: &str = "tests/tests/fit.rs";
pub const REFUSALS: &str = "tools/cli/tests/refusals.rs";
pub const WHOLE: &str = "tools/cli/tests/whole.rs";
pub const INTERRUPTIONS: &str = "tools/cli/tests/interruptions.rs";
pub const SURROUNDINGS: &str = "tools/cli/tests/surroundings.rs";
pub const OUTPUT: &str = "engine/base/src/output.rs";
pub const DICOM: &str = "engine/volume/src/dicom/tests/mod.rs";
pub const FUZZ: &str = "tools/research/fuzz/tests/readers.rs";
pub const MEMORY: &str = "tools/research/fuzz/tests/memory.rs";

/// A row of [`REFUSALS`], or several.
pub const fn refused(cases: &'static [&'static str]) -> Test {
    t(REFUSALS, "bad_inputs_are_refused_and_nothing_is_touched", cases)
}

/// A row of what is malformed in NIfTI, or several.
pub const fn malformed(cases: &'static [&'static str]) -> Test {
    t(NIFTI, "malformed_files_are_refused", cases)
}

/// A row of what is odd in NIfTI, or several.
pub const fn odd(cases: &'static [&'static str]) -> Test {
    t(NIFTI, "oddities_that_are_read", cases)
}

/// A row of what is wrong in a PLY, or several.
pub const fn wrong_ply(cases: &'static [&'static str]) -> Test {
    t(PLY, "wrong_files_are_refused_with_a_reason", cases)
}

/// What is tried with files that nobody thought of.
pub const ALL_READERS: &[Test] =
    &[t(FUZZ, "readers_survive_what_they_are_given", &[]), t(MEMORY, "memory_follows_what_is_read", &[])];
