//! Measures what accuracy costs (`studies trade`), as figures and as Pareto fronts: the points that no other
//! is better and cheaper than.

pub mod fit;
mod front;
mod plot;
pub mod render;

use clap::Subcommand;

/// Part of the program that is studied.
#[derive(Subcommand)]
pub enum TradeStudy {
    /// Fits: error against seconds, bytes of the file and device memory.
    Fit(fit::FitTradeArguments),
    /// Pictures: error against the time of a frame, and the quality levels of the frame budget.
    Render(render::PictureTradeArguments),
}
