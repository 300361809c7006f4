//! Sections of the report.

use clap::ValueEnum;

/// Sections that `--only` can choose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Section {
    /// Worst and best MMSE and PSNR of every row
    Table2,
    /// Downsampled volumes; alone: all of the data, checked against its README.md
    Table3,
    /// Terms of the paper's loss
    Table4,
    /// Counts, time and memory of every row
    Table6,
    /// Terms of the default loss
    Ablation,
    /// Splats per voxel from 0.005 to 0.25
    Density,
    /// --profile paper against a prototype, and what its choices are worth
    Findings,
    /// --profile reference beside the authors' own code, and what each difference from the paper's text is
    /// worth
    Reference,
}
