//! Benchmarks of the fit.
fn main() {}
