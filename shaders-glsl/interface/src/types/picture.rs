//! What the kernels of standard splats on pictures share with the host.

use bytemuck::{Pod, Zeroable};

use super::View;

shared! {
    /// A standard splat on a picture; see `include/picture.glsl`.
    PictureSplat {
        /// Place of the centre, pixels from the upper left corner.
        centre: [f32; 2],
        /// xx, xy and yy of the inverse of its covariance, 1/pixels².
        conic: [f32; 3],
        /// Opacity in the middle; 0 if it is not drawn.
        opacity: f32,
        /// Colour towards the eye, not premultiplied.
        colour: [f32; 3],
        /// z of the centre, mm.
        depth: f32,
    }
    /// Push constants of `picture_project` and `picture_project_grad`.
    PictureProjectParams {
        /// The eye.
        view: View,
        /// Width and height of the picture, pixels.
        size: [u32; 2],
        /// Number of splats.
        splat_count: u32,
        /// Number of coefficients of a colour.
        coefficients: u32,
        /// Depth of the least key, mm.
        nearest: f32,
        /// Depth of the greatest key, mm.
        farthest: f32,
        /// What the variances of splats on the picture grow by, pixels².
        widening: f32,
    }
    /// Push constants of `picture_pairs`.
    PicturePairParams {
        /// Width and height of the picture, pixels.
        size: [u32; 2],
        /// Number of splats.
        splat_count: u32,
        /// Greatest number of pairs.
        capacity: u32,
    }
    /// Push constants of `picture_blend`.
    PictureBlendParams {
        /// Width and height of the picture, pixels.
        size: [u32; 2],
        /// Colour behind all splats.
        background: [f32; 3],
    }
    /// Push constants of `picture_blend_grad`.
    PictureBlendGradParams {
        /// Width and height of the picture, pixels.
        size: [u32; 2],
    }
    /// Push constants of `picture_ssim` and `picture_loss_grad`.
    PictureLossParams {
        /// Width and height of the picture, pixels.
        size: [u32; 2],
        /// Colour behind all splats.
        background: [f32; 3],
        /// Weight λ of 1 - SSIM; that of the absolute error is 1 - λ.
        ssim_weight: f32,
    }
    /// Push constants of `adam_harmonics`.
    AdamHarmonicsParams {
        /// Number of splats.
        splat_count: u32,
        /// Number of coefficients of a splat.
        coefficients: u32,
        /// Greatest number of pairs.
        capacity: u32,
        /// β₁.
        beta1: f32,
        /// β₂.
        beta2: f32,
        /// 1 / (1 - β₁^t).
        correction1: f32,
        /// 1 / (1 - β₂^t).
        correction2: f32,
        /// ε.
        epsilon: f32,
        /// Rate of the first coefficient of a splat.
        rate: f32,
        /// Rate of the others.
        rate_rest: f32,
    }
}
