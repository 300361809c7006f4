//! Faces around what a look can show of a volume, in cubes of bricks, and the pixels that they cover: where a
//! ray may meet something.

use shaders_glsl as glsl;
use shaders_glsl::types::{BrickGrid, FacesParams, MarkParams};

use super::Views;
use base::error::Result;
use gpu::{Buffer, Drawing, Gpu, Image, Kernel, Recorder};

/// Lists the faces.
pub struct Faces {
    kernel: Kernel,
    grid: BrickGrid,
    /// Number of cubes along x, y, z.
    cubes: [u32; 3],
    /// The faces, as `include/faces.glsl` numbers them.
    pub rows: Buffer<u32>,
    /// Arguments of their drawing, six vertices each: vertices, one instance, and the first of each.
    pub arguments: Buffer<[u32; 4]>,
}

impl Faces {
    /// Creates the pass for the bricks of an [`super::Occupancy`].
    pub fn new(gpu: &Gpu, grid: BrickGrid) -> Result<Self> {
        let cubes = grid.bricks.map(|n| n.div_ceil(glsl::faces::CUBE));
        let [x, y, z] = cubes.map(|n| n as usize);
        // Each lies between two cubes, or between one and what is around.
        let most = (x + 1) * y * z + x * (y + 1) * z + x * y * (z + 1);
        Ok(Faces {
            kernel: Kernel::new(gpu, &glsl::LIST_FACES, &[])?,
            grid,
            cubes,
            rows: gpu.buffer("faces", "volume", most)?,
            arguments: gpu.buffer("faces to draw", "volume", 1)?,
        })
    }

    /// Records the listing; `distances` are those of the [`super::Occupancy`].
    pub fn record(&mut self, recorder: &mut Recorder, distances: &Buffer<u32>) {
        recorder.clear(&self.arguments);
        recorder
            .pass(&self.kernel)
            .read("distances", distances)
            .write("faces", &mut self.rows)
            .write_words("arguments", &mut self.arguments)
            .push(&FacesParams { grid: self.grid })
            .dispatch_over(self.cubes.iter().product());
    }

    /// Creates the drawing that [`Faces::mark`] needs.
    pub fn marking(gpu: &Gpu, marks: &Image) -> Result<Drawing> {
        let shaders = [&glsl::MARK_FACES_VERT, &glsl::MARK_FACES_FRAG];
        Drawing::new(gpu, shaders[0], shaders[1], &[], &[marks.format()], marks.layers())
    }

    /// Records the marking of the pixels that faces cover in the upper left corner of `marks`, a picture of
    /// depth, `size` pixels large: 0.5 there, and 0 elsewhere.
    pub fn mark(
        &self,
        recorder: &mut Recorder,
        marking: &Drawing,
        views: &Views,
        voxel_from_scene: [[f32; 4]; 3],
        size: [u32; 2],
        marks: &mut Image,
    ) {
        recorder.clear_image(marks, [0.0; 4]);
        recorder
            .draw(marking)
            .read("views", &views.rows)
            .read("faces", &self.rows)
            .push(&MarkParams { grid: self.grid, voxel_from_scene, size })
            .within(size)
            .over(&mut [marks], &self.arguments, 0);
    }
}
