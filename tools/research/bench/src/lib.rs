//! Benchmarks of vgs, which tell users and CI what the programs cost and how right they are. Each checks what
//! it measures before it times it, warms up, takes many runs and reports medians with device and driver. The
//! experiments behind published figures are in `tools/research/studies`, which uses the same tables, plots, scenes and
//! stores of results.
#![forbid(unsafe_code)]

pub mod budget;
pub mod cost;
pub mod eyes;
pub mod gpu;
pub mod isa;
pub mod passes;
pub mod plot;
pub mod progress;
pub mod render;
pub mod report;
pub mod scene;
pub mod store;
pub mod xr;
