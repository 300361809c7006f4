//! `studies trade`: what accuracy costs, as figures and as fronts: the points that no other is better and cheaper than.

pub mod fit;
mod front;
mod plot;
pub mod render;

use clap::Subcommand;

/// Which side of the program.
#[derive(Subcommand)]
pub enum TradeStudy {
    /// Fits: error against seconds, bytes of the file and device memory.
    Fit(fit::FitTradeArguments),
    /// Pictures: error against the time of a frame, and the ladder of the frame budget.
    Render(render::PictureTradeArguments),
}
