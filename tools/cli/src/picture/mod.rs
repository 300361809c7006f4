//! Draws the comparison of splats with their volume.
//!
//! | file | subject |
//! |---|---|
//! | `evaluation` | the picture of an evaluation, with its figures: what commands draw |
//! | `sheet` | the layout of the picture |
//! | `slices` | three orthogonal slices of CT, splats and difference |
//! | `solid` | shaded views of CT and splats |
//! | `subject` | what is shown: CT, region and splats on one grid |
//! | `canvas` | the canvas that is drawn on |

mod canvas;
mod evaluation;
mod sheet;
mod slices;
mod solid;
mod subject;

pub use evaluation::{draw, names};
