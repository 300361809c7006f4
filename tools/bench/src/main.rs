//! `bench`: figures, not tests. Each benchmark checks what it measures before it times it, warms up, takes many runs and
//! reports medians with device and driver.
#![forbid(unsafe_code)]

mod budget;
mod cost;
mod eyes;
mod model;
mod paper;
mod passes;
mod plot;
mod render;
mod report;
mod scene;
mod store;
mod trade;
mod xr;

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
  bench paper --data DIR --quick    the paper's tables beside ours in a quarter of an hour; bench paper --help
  bench render --data DIR --quick   pictures against what they should be, and their time; bench render --help
  bench trade fit ct.nii.gz --roi bones.nii.gz   what a fit's accuracy costs; bench trade fit --help
  bench trade render --data DIR     what a picture's accuracy costs, and the ladder of the frame budget
  bench budget --plot traces.svg    the frame-budget controller on simulated GPUs
  bench xr bones.ply                sessions in a simulated headset at several budgets
  bench eyes bones.ply              what the rims of lenses and foveation save
  bench model fit *.ply --out DIR   what a frame costs, from the work that it is made of; bench model fit --help
  bench model headset *.ply --out DIR    what a standalone headset would take for it"
)]
struct Arguments {
    /// Device by index or part of its name, as `vgs devices` lists them.
    #[arg(long, global = true)]
    device: Option<String>,
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Forward and backward pass of the fit: evaluations per second, waste, and growth.
    Passes(passes::Arguments),
    /// The paper's tables: the paper's figures, ours with --profile paper, and ours by default.
    Paper(paper::Arguments),
    /// The frame-budget controller on simulated GPUs.
    Budget(budget::Arguments),
    /// Sessions in a simulated headset: intervals, missed frames, use of the budget, rungs, latency.
    Xr(xr::Arguments),
    /// What the rims of a headset's lenses and foveation save, and what foveation gives up.
    Eyes(eyes::Arguments),
    /// What accuracy costs, of fits and of pictures, and where the front is.
    #[command(subcommand)]
    Trade(trade::What),
    /// What a frame costs, from the work that it is made of, here and on devices that are not at hand.
    #[command(subcommand)]
    Model(model::What),
    /// Pictures of all modes against what they should be, and what frames cost.
    Render(render::Arguments),
}

fn main() -> std::process::ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error[{}]: {e}", e.code);
            if !e.help.is_empty() {
                eprintln!("  help: {}", e.help);
            }
            std::process::ExitCode::from(e.kind.exit_code())
        }
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    let options = GpuOptions { device: arguments.device.clone(), ..GpuOptions::default() };
    match &arguments.what {
        What::Passes(a) => passes::run(&Gpu::new(&options)?, a),
        What::Paper(a) => paper::run(&options, a),
        What::Budget(a) => budget::run(a),
        What::Xr(a) => xr::run(&Gpu::new(&options)?, a),
        What::Eyes(a) => eyes::run(&Gpu::new(&options)?, a),
        What::Render(a) => render::run(&options, a),
        What::Model(model::What::Fit(a)) => model::fit(&Gpu::new(&options)?, a),
        What::Model(model::What::Headset(a)) => model::headset(&Gpu::new(&options)?, a),
        What::Trade(trade::What::Fit(a)) => trade::fit::run(&options, a),
        What::Trade(trade::What::Render(a)) => trade::render::run(&options, a),
    }
}
