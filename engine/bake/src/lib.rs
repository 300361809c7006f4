//! Baking: standard splats, of fixed colours and opacities, that show in other programs what a transfer function and a
//! light show of a fit.
//!
//! Pictures of the fit are the truth here: [`bake()`] renders it in mode decoded from all around and moves the splats
//! that [`render::baked`](fn@render::baked) makes until alpha blending, as other viewers do it, gives these pictures
//! (Kerbl et al., "3D Gaussian Splatting", 2023). The intensities are lost, so the function can no longer change.
//!
//! | file | what is there |
//! |---|---|
//! | `options` | [`Options`]: how many pictures, how large, how long |
//! | `views` | cameras all around, and the pictures that are wanted there |
//! | `pictures` | the error of these pictures, as the objective of training |
//! | `training` | splats on the device, moved by the derivatives of pictures |
//! | `splitting` | more splats where the pictures ask for them |
//! | `state` | [`BakeState`]: what interrupted training leaves, and its file |
//! | `baking` | [`bake()`]: all of it, [`train`] from any splats, and [`Report`]: how near the pictures come, on views that were not trained |
#![forbid(unsafe_code)]

mod baking;
mod options;
mod pictures;
mod splitting;
mod state;
mod training;
mod views;

pub use baking::{Baked, Progress, Report, Trained, bake, check, pictures, train};
pub use options::{MeanRate, Options, Rates};
pub use state::{BakeState, CurvePoint};
pub use views::Views;
