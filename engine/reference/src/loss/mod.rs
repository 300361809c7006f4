//! Loss terms: a file for each kernel `loss_x` gives value, weight and adjoint of its term at a sample, and says with what
//! numbers tests try it; it is a row of [`LOSSES`]. `overlap_sums` and `sum_triples` sum what a Dice loss needs of all
//! samples first.

mod dice;
mod kl;
mod leak;
mod loss;
mod mse;
mod occupancy;
mod square;
mod tail;
mod terms;

pub use kl::LEAST as KL_LEAST;
pub use loss::{Loss, Numbers, Overlap, Quantity, TermAt, Trial, predicted_mask};
pub use terms::{LOSSES, Term, adjoints, fold, overlap_sums, sum_triples, sums};
