//! The command line of vgs.
fn main() {}
