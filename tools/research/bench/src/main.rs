//! Command line of the benchmarks (`bench`).
#![forbid(unsafe_code)]

use bench::{budget, eyes, gpu, isa, passes, render, xr};
use clap::{Parser, Subcommand};
use engine::Result;
use engine::gpu::{Gpu, GpuOptions};

#[derive(Parser)]
#[command(
    name = "bench",
    about = "Benchmarks of vgs",
    after_help = "\
Examples:
  bench passes                      forward and backward passes, growth with splats and with ROI voxels
  bench passes --quick              the same in half a minute
  bench passes --volume ct.nii.gz --roi bones.nii.gz --density 0.1 --markdown passes.md
  bench render --data DIR --quick   pictures against what they should be, and their time; bench render --help
  bench budget --plot traces.svg    the frame-budget controller on simulated GPUs
  bench xr bones.ply                sessions in a simulated headset at several budgets
  bench eyes bones.ply              what the rims of lenses and foveation save
  bench gpu                         all that a GPU can tell, in one folder; bench gpu --help
  bench isa                         registers, spills and waves of the kernels on GPUs that are not there"
)]
struct BenchArguments {
    /// Device by index or part of its name, as `vgs devices` lists them.
    #[arg(long, global = true)]
    device: Option<String>,
    #[command(subcommand)]
    benchmark: Benchmark,
}

#[derive(Subcommand)]
enum Benchmark {
    /// Forward and backward pass of the fit: evaluations per second, waste, and growth.
    Passes(passes::PassesArguments),
    /// The frame-budget controller on simulated GPUs.
    Budget(budget::BudgetArguments),
    /// Sessions in a simulated headset: intervals, missed frames, use of the budget, quality levels, latency.
    Xr(xr::XrArguments),
    /// What the rims of a headset's lenses and foveation save, and what foveation gives up.
    Eyes(eyes::EyesArguments),
    /// Everything that a GPU can tell, in one folder.
    Gpu(gpu::GpuArguments),
    /// What the compiler of AMD GPUs makes of the kernels, without a GPU: registers, spills, waves.
    Isa(isa::IsaArguments),
    /// Pictures of all modes against what they should be, and what frames cost.
    Render(render::RenderArguments),
}

fn main() -> std::process::ExitCode {
    bench::report::exit(run(&BenchArguments::parse()))
}

fn run(arguments: &BenchArguments) -> Result<()> {
    let options = GpuOptions { device: arguments.device.clone(), ..GpuOptions::default() };
    match &arguments.benchmark {
        Benchmark::Passes(a) => passes::run(&Gpu::new(&options)?, a),
        Benchmark::Budget(a) => budget::run(a),
        Benchmark::Xr(a) => xr::run(&Gpu::new(&options)?, a),
        Benchmark::Eyes(a) => eyes::run(&Gpu::new(&options)?, a),
        Benchmark::Gpu(a) => gpu::run(&options, a),
        Benchmark::Isa(a) => isa::run(&options, a),
        Benchmark::Render(a) => render::run(&options, a),
    }
}
