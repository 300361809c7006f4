//! Gradients of O (V − v₀) at the voxels of a volume or of an atlas, from which a ray march takes those between them by
//! one interpolation instead of six differences.

use shaders_glsl as glsl;
use shaders_glsl::medium::APRONED;
use shaders_glsl::types::{Appearance, BrickGrid, VoxelGradientParams};

use base::error::Result;
use gpu::{Buffer, Format, Gpu, Image, Kernel, Recorder};

/// Stands for the coordinates and the level of a brick where an atlas has none.
pub const NOWHERE: [u32; 4] = [u32::MAX; 4];
/// Edge of what a workgroup does of a dense image, voxels.
const DENSE: u32 = 8;
/// The greatest O (V − v₀), V as a fraction, times the unit of the gradients: a half has room for twice as much, and
/// keeps one step of V apart.
const GREATEST: f32 = 8192.0;

/// What the gradients are made of.
#[derive(Clone, Copy)]
pub struct GradientSource<'a> {
    /// Bricks by which the image is leapt over; of an atlas, the grid that it is of.
    pub grid: BrickGrid,
    /// V and O as fractions; or V alone.
    pub medium: &'a Image,
    /// What the image is: `ATLAS` of the shaders.
    pub atlas: u32,
    /// Places of the bricks in an atlas.
    pub places: &'a Buffer<u32>,
    /// Labels of the voxels.
    pub labels: &'a Image,
    /// Appearances by label; they count if there are objects.
    pub appearances: &'a Buffer<Appearance>,
    /// True if objects leave different parts of their O.
    pub objects: bool,
}

/// The gradients: of each voxel [`VoxelGradients::unit`] × ∂(O (V − v₀)) over two voxels along x, y and z, V as a fraction and O
/// as far as the opacities of objects leave it; halves, of which one is free.
pub struct VoxelGradients {
    /// The image, in the shape of that of the medium.
    pub image: Image,
    /// Coordinates and level of the brick of the grid at each place of an atlas, or [`NOWHERE`].
    bricks: Buffer<[u32; 4]>,
}

impl VoxelGradients {
    /// Creates the image for a medium; of an atlas, `bricks` are the coordinates and the level of the brick at each of its places, x
    /// fastest.
    ///
    /// # Errors
    /// If there is no memory for it: eight bytes a texel.
    pub fn new(gpu: &Gpu, medium: &Image, bricks: &[[u32; 4]]) -> Result<Self> {
        Ok(VoxelGradients {
            image: gpu.volume("gradients", "gradients", Format::Rgba16f, medium.size())?,
            bricks: gpu.upload("bricks of places", "gradients", bricks)?,
        })
    }

    /// Returns the factor of the gradients for a v₀, as a fraction: they fit halves, whatever it is.
    pub fn unit(dark: f32) -> f32 {
        GREATEST / dark.abs().max((1.0 - dark).abs())
    }

    /// Records the making of all gradients for a v₀, as a fraction.
    pub fn record(
        &mut self,
        gpu: &Gpu,
        recorder: &mut Recorder,
        of: &GradientSource<'_>,
        dark: f32,
    ) -> Result<()> {
        let masked = of.medium.format() == Format::Rg16;
        let objects = if of.objects { glsl::medium::TINTS } else { 0 };
        let constants = [u32::from(masked), of.atlas, objects];
        let kernel = Kernel::new(gpu, &glsl::VOXEL_GRADIENTS, &constants)?;
        let edge = if of.atlas == 0 { DENSE } else { APRONED };
        recorder
            .pass(&kernel)
            .read("brick_at", &self.bricks)
            .write_image("gradients", &mut self.image)
            .sample("medium", of.medium)
            .read("places", of.places)
            .sample("labels", of.labels)
            .read("appearances", of.appearances)
            .push(&VoxelGradientParams { grid: of.grid, dark, unit: Self::unit(dark) })
            .dispatch_3d(of.medium.size().map(|n| n.div_ceil(edge)));
        Ok(())
    }
}
