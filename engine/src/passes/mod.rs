//! One file per kernel or group of kernels that belong together: the pipelines, the scratch buffers, and how they are
//! recorded. A pass knows buffers and counts; what they mean for a fit is `fit`'s business.

pub mod adam;
pub mod bin;
pub mod gradient;
pub mod loss;
mod pace;
pub mod radix_sort;
pub mod rasterise;
pub mod scan;

pub use adam::Adam;
pub use bin::Binner;
pub use gradient::Gradient;
pub use loss::Losses;
pub use pace::Pace;
pub use radix_sort::RadixSort;
pub use rasterise::{Rasteriser, Shape};
pub use scan::Scan;
pub use shaders_glsl::types::{Adjoint, Reconstruction, SplatGrad, Target};
