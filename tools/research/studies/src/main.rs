//! `studies`: the experiments behind the published figures. Their results lie in `docs/results`. Each run is
//! kept as a file, so that a study that was stopped can go on.
#![forbid(unsafe_code)]

mod bake;
mod code;
mod hybrid;
mod images;
mod model;
mod paper;
mod seams;
mod soak;
mod trade;

use clap::{Parser, Subcommand};
use engine::Result;
use engine::gpu::{Gpu, GpuOptions};

#[derive(Parser)]
#[command(
    name = "studies",
    about = "The experiments behind the published figures of vgs",
    after_help = "\
Examples:
  studies paper --data DIR --quick    the paper's tables beside ours in a quarter of an hour; \
studies paper --help
  studies trade fit ct.nii.gz --roi bones.nii.gz    what a fit's accuracy costs; studies trade fit --help
  studies trade render --data DIR     what a picture's accuracy costs, and the quality levels \
of the frame budget
  studies model *.ply --out DIR       what a standalone headset would take for a frame
  studies code ct.nii.gz --roi bones.nii.gz    bytes of a region with a bound on every voxel's error
  studies bake bones.ply      how near splats for other viewers come to the pictures of a fit
  studies images ct.nii.gz --roi bones.nii.gz --fit bones.ply    splats trained by pictures beside a fit
  studies hybrid ct.nii.gz --roi bones.nii.gz --fit bones.ply    a fit sharpened by pictures of several functions
  studies seams ct.nii.gz --whole bones.vgs bones/*.vgs    whether a fit in blocks shows where they meet
  studies soak --minutes 60           whether memory stays as it is"
)]
struct StudiesArguments {
    /// Device by index or part of its name, as `vgs devices` lists them.
    #[arg(long, global = true)]
    device: Option<String>,
    #[command(subcommand)]
    study: Study,
}

#[derive(Subcommand)]
enum Study {
    /// The paper's tables: the paper's figures, ours with --profile paper, and ours by default.
    Paper(paper::PaperArguments),
    /// What accuracy costs, of fits and of pictures, and where the front is.
    #[command(subcommand)]
    Trade(trade::TradeStudy),
    Model(model::ModelArguments),
    Bake(bake::BakeArguments),
    Code(code::CodeArguments),
    Hybrid(hybrid::HybridArguments),
    Images(images::ImagesArguments),
    Seams(seams::SeamsArguments),
    Soak(soak::SoakArguments),
}

fn main() -> std::process::ExitCode {
    bench::report::exit(run(&StudiesArguments::parse()))
}

fn run(arguments: &StudiesArguments) -> Result<()> {
    let options = GpuOptions { device: arguments.device.clone(), ..GpuOptions::default() };
    match &arguments.study {
        Study::Paper(a) => paper::run(&options, a),
        Study::Trade(trade::TradeStudy::Fit(a)) => trade::fit::run(&options, a),
        Study::Trade(trade::TradeStudy::Render(a)) => trade::render::run(&options, a),
        Study::Model(a) => model::run(&Gpu::new(&options)?, a),
        Study::Bake(a) => bake::run(&Gpu::new(&options)?, a),
        Study::Code(a) => code::run(a),
        Study::Hybrid(a) => hybrid::run(&Gpu::new(&options)?, a),
        Study::Images(a) => images::run(&Gpu::new(&options)?, a),
        Study::Seams(a) => seams::run(&Gpu::new(&options)?, a),
        Study::Soak(a) => soak::run(&options, a),
    }
}
