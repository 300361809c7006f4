//! Standard splats on a picture, the loss of the picture, and its derivatives by the splats: alpha blending as other
//! programs draw it (Kerbl et al. 2023), in tiles and from front to back.
//!
//! No float is added atomically: a tile sums up for each of its splats what its pixels say, and a splat adds up its
//! tiles. The same splats and views give the same bits.

use shaders_glsl as glsl;
use shaders_glsl::types::{
    AdamHarmonicsParams, PictureBlendGradParams, PictureBlendParams, PictureLossParams, PicturePairParams,
    PictureProjectParams, PictureSplat, SplatGrad, View,
};

use super::pair_lists::{PairLists, key_bits};
use super::{RadixSort, Rows, WorkgroupShape};
use base::error::{Error, Kind, Result};
use gpu::{Buffer, Gpu, Kernel, Recorder};
use splat::Splat;

/// Edge of a tile, pixels.
const TILE: u32 = glsl::picture::PICTURE_TILE;
/// Floats that a pair of a tile and a splat has.
const MOMENTS: usize = glsl::picture::PICTURE_MOMENTS as usize;
/// Bytes of these.
const MOMENT_BYTES: usize = MOMENTS * size_of::<f32>();
/// Edge of a tile of the loss, pixels.
const LOSS_TILE: u32 = glsl::picture_loss::LOSS_TILE;
/// Bits of the keys by which splats are sorted.
const DEPTH_BITS: u32 = 32 - glsl::picture::DEPTH_STEPS.leading_zeros();
/// Longest edge of a picture, pixels: every device dispatches as many workgroups as it has tiles.
pub const LONGEST: u32 = 1920;

/// A picture to be drawn: from where, and before what.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    /// The eye, in the space of the splats.
    pub view: View,
    /// Least and greatest depth of a splat, mm; others keep their order only among those that are inside.
    pub depths: [f32; 2],
    /// What the variances of splats on the picture grow by, pixels²; viewers have 0.3.
    pub widening: f32,
    /// Colour behind all splats.
    pub background: [f32; 3],
}

/// What a picture is drawn of.
pub struct Splats<'a> {
    /// Parameters; intensities do not count.
    pub splats: &'a Buffer<Splat>,
    /// Coefficients of the colours, by splat and coefficient: red, green, blue.
    pub harmonics: &'a Buffer<[f32; 3]>,
}

/// Adam's state of the harmonics.
pub struct HarmonicsState {
    /// Coefficients, by splat and coefficient: red, green, blue.
    pub harmonics: Buffer<[f32; 3]>,
    /// First moments.
    pub first: Buffer<[f32; 3]>,
    /// Second moments.
    pub second: Buffer<[f32; 3]>,
}

impl HarmonicsState {
    /// Creates the state with these coefficients and moments of zero.
    pub fn new(gpu: &Gpu, coefficients: &[[f32; 3]]) -> Result<Self> {
        Ok(HarmonicsState {
            harmonics: gpu.upload("harmonics", "splats", coefficients)?,
            first: gpu.buffer("first moments of harmonics", "optimiser", coefficients.len())?,
            second: gpu.buffer("second moments of harmonics", "optimiser", coefficients.len())?,
        })
    }
}

/// Draws pictures of one size of one number of splats, and differentiates them.
pub struct Picture {
    gpu: Gpu,
    project: Kernel,
    emit: Kernel,
    blend: Kernel,
    ssim: Kernel,
    loss_grad: Kernel,
    blend_grad: Kernel,
    project_grad: Kernel,
    adam: Kernel,
    pairs: PairLists,
    size: [u32; 2],
    splat_count: usize,
    coefficients: usize,
    tile_bits: u32,
    /// Sorts the splats by depth.
    sort: RadixSort,
    rows_by_depth: Rows,
    total: Buffer<u32>,
    tile_counts: Buffer<u32>,
    seen: Buffer<PictureSplat>,
    pair_splats: Buffer<u32>,
    moments: Buffer<f32>,
    needed: Buffer<u32>,
    /// Number of pairs that the last picture needs, on the device; one element.
    pub pair_totals: Buffer<u32>,
    /// Colour over the background and what passes, by pixel from the upper left corner, rows from above.
    pub colours: Buffer<[f32; 4]>,
    ends: Buffer<u32>,
    slopes: Buffer<[f32; 3]>,
    losses: Buffer<[f32; 2]>,
    /// dL/dC of each pixel.
    pub picture_gradient: Buffer<[f32; 3]>,
    /// dL/d(parameters), one row a splat; that of the intensity is 0.
    pub rows: Buffer<SplatGrad>,
    /// dL/d(coefficients), by splat and coefficient.
    pub harmonic_rows: Buffer<[f32; 3]>,
}

impl Picture {
    /// Creates the passes for pictures of `size` pixels of `splat_count` splats with `coefficients` each.
    ///
    /// # Errors
    /// [`Kind::Unavailable`] for a picture without pixels or with an edge above [`LONGEST`]; those of buffers that this
    /// device cannot have.
    pub fn new(gpu: &Gpu, splat_count: usize, coefficients: usize, size: [u32; 2]) -> Result<Self> {
        Self::with_shape(gpu, splat_count, coefficients, size, WorkgroupShape::of(gpu))
    }

    /// Creates the passes with the given workgroup shape; pictures have the same bits.
    ///
    /// # Errors
    /// As of [`Picture::new`].
    pub fn with_shape(
        gpu: &Gpu,
        splat_count: usize,
        coefficients: usize,
        size: [u32; 2],
        shape: WorkgroupShape,
    ) -> Result<Self> {
        let tiles = size.map(|pixels| pixels.div_ceil(TILE) as usize);
        let lists = tiles[0] * tiles[1];
        let tile_bits = key_bits(lists);
        if lists == 0 || size.iter().any(|&edge| edge > LONGEST) {
            let message = format!("pictures of {} x {} pixels", size[0], size[1]);
            return Err(Error::new(Kind::Unavailable, "VGS-BAKE-001", message)
                .help("train with pictures of at most 1920 x 1920 pixels"));
        }
        let pixels = size[0] as usize * size[1] as usize;
        let loss_tiles = size.map(|pixels| pixels.div_ceil(LOSS_TILE) as usize);
        let mut pairs = PairLists::new(gpu, splat_count, lists)?;
        let most = pairs.most(gpu.limits().storage_range as usize / MOMENT_BYTES);
        if pairs.capacity() > most {
            pairs.make_room(most)?;
        }
        let capacity = pairs.capacity();
        let kernel = |shader| Kernel::new(gpu, shader, &[]);
        let shaped = |shader| Kernel::new(gpu, shader, &[shape as u32]);
        Ok(Picture {
            gpu: gpu.clone(),
            project: kernel(&glsl::PICTURE_PROJECT)?,
            emit: kernel(&glsl::PICTURE_PAIRS)?,
            blend: shaped(&glsl::PICTURE_BLEND)?,
            ssim: kernel(&glsl::PICTURE_SSIM)?,
            loss_grad: kernel(&glsl::PICTURE_LOSS_GRAD)?,
            blend_grad: shaped(&glsl::PICTURE_BLEND_GRAD)?,
            project_grad: kernel(&glsl::PICTURE_PROJECT_GRAD)?,
            adam: kernel(&glsl::ADAM_HARMONICS)?,
            pairs,
            size,
            splat_count,
            coefficients,
            tile_bits,
            sort: RadixSort::new(gpu, splat_count)?,
            rows_by_depth: Rows::new(gpu)?,
            total: gpu.upload("number of splats", "sorting", &[splat_count as u32])?,
            tile_counts: gpu.buffer("tile counts", "sorting", splat_count)?,
            seen: gpu.buffer("splats on the picture", "views", splat_count)?,
            pair_splats: gpu.buffer("splats of pairs", "sorting", capacity)?,
            moments: gpu.buffer("moments of pairs", "optimiser", capacity * MOMENTS)?,
            needed: gpu.readback("pairs needed", 1)?,
            pair_totals: gpu.buffer("pair totals", "sorting", 1)?,
            colours: gpu.buffer("picture", "views", pixels)?,
            ends: gpu.buffer("ends of pixels", "views", pixels)?,
            slopes: gpu.buffer("slopes of the loss", "optimiser", 3 * pixels)?,
            losses: gpu.buffer("losses of tiles", "optimiser", loss_tiles[0] * loss_tiles[1])?,
            picture_gradient: gpu.buffer("gradient of the picture", "optimiser", pixels)?,
            rows: gpu.buffer("gradients", "optimiser", splat_count)?,
            harmonic_rows: gpu.buffer("gradients of harmonics", "optimiser", splat_count * coefficients)?,
        })
    }

    /// Returns the number of pairs that fit the buffers.
    pub fn capacity(&self) -> usize {
        self.pairs.capacity()
    }

    /// Returns the number of pairs that the last finished picture needed.
    pub fn needed(&self) -> Result<usize> {
        Ok(self.needed.mapped()?[0] as usize)
    }

    /// Grows the buffers to at least `pairs` pairs, with a margin. Nothing may be in flight.
    ///
    /// # Errors
    /// [`Kind::Temporary`] if no buffer of this device holds so many.
    pub fn grow(&mut self, pairs: usize) -> Result<()> {
        let most = self.pairs.most(self.gpu.limits().storage_range as usize / MOMENT_BYTES);
        if pairs > most {
            let message =
                format!("{pairs} pairs of a splat and a tile are needed at once; this device binds {most}");
            return Err(Error::new(Kind::Temporary, "VGS-BAKE-002", message)
                .help("train with smaller pictures or fewer splats"));
        }
        let room = (pairs + pairs / 4).min(most);
        self.pairs.make_room(room)?;
        self.pair_splats = self.gpu.buffer("splats of pairs", "sorting", room)?;
        self.moments = self.gpu.buffer("moments of pairs", "optimiser", room * MOMENTS)?;
        Ok(())
    }

    fn params(&self, shot: &Shot) -> PictureProjectParams {
        PictureProjectParams {
            view: shot.view,
            nearest: shot.depths[0],
            farthest: shot.depths[1],
            widening: shot.widening,
            size: self.size,
            splat_count: self.splat_count as u32,
            coefficients: self.coefficients as u32,
        }
    }

    fn tiles(&self) -> u32 {
        self.size.map(|pixels| pixels.div_ceil(TILE)).iter().product()
    }

    /// Records a picture. Where it needs more pairs than there is room for, it lacks some, [`Picture::needed`] tells
    /// it afterwards, and [`Picture::pair_totals`] tells it to the optimiser.
    pub fn draw(&mut self, recorder: &mut Recorder, of: &Splats<'_>, shot: &Shot) {
        let rows = self.splat_count;
        let params = self.params(shot);
        let (keys, values) = self.sort.input();
        recorder
            .pass(&self.project)
            .read("splats", of.splats)
            .read("harmonics_of", of.harmonics)
            .write("picture_splats", &mut self.seen)
            .write("tile_counts", &mut self.tile_counts)
            .write("keys", keys)
            .write("values", values)
            .push(&params)
            .dispatch_over(rows as u32);
        let (_, order) = self.sort.record(recorder, &self.total, 0, DEPTH_BITS);
        self.rows_by_depth.gather(recorder, &self.tile_counts, order, 0, &mut self.pairs.counts);
        self.pairs.sum(recorder, rows, &mut self.needed, 0);
        let capacity = self.pairs.capacity() as u32;
        let (pair_offsets, keys, values) = self.pairs.input();
        recorder.copy(pair_offsets, rows, &mut self.pair_totals, 0, 1);
        recorder
            .pass(&self.emit)
            .read("order", order)
            .read("picture_splats", &self.seen)
            .read("pair_offsets", pair_offsets)
            .write("keys", keys)
            .write("values", values)
            .write("pair_splats", &mut self.pair_splats)
            .push(&PicturePairParams { size: self.size, splat_count: rows as u32, capacity })
            .dispatch_over(rows as u32);
        let tiles = self.tiles();
        self.pairs.sort(recorder, rows, self.tile_bits, tiles);
        recorder
            .pass(&self.blend)
            .read("starts", &self.pairs.starts)
            .read("pairs", self.pairs.values(self.tile_bits))
            .read("pair_splats", &self.pair_splats)
            .read("picture_splats", &self.seen)
            .write("picture", &mut self.colours)
            .write("ends", &mut self.ends)
            .push(&PictureBlendParams { size: self.size, background: shot.background })
            .dispatch(tiles);
    }

    /// Records the loss of the picture that was drawn last, and its derivative by the colours. `wanted` has a word a
    /// pixel: red lowest, colours times opacity, opacity.
    pub fn compare(
        &mut self,
        recorder: &mut Recorder,
        wanted: &Buffer<u32>,
        background: [f32; 3],
        ssim_weight: f32,
    ) {
        let params = PictureLossParams { size: self.size, background, ssim_weight };
        let invocations = [self.size[0], self.size[1].div_ceil(glsl::picture_loss::RUN), 1];
        recorder
            .pass(&self.ssim)
            .read("picture", &self.colours)
            .read("wanted", wanted)
            .write("slopes", &mut self.slopes)
            .write("losses", &mut self.losses)
            .push(&params)
            .dispatch_over_3d(invocations);
        recorder
            .pass(&self.loss_grad)
            .read("picture", &self.colours)
            .read("wanted", wanted)
            .read("slopes", &self.slopes)
            .write("picture_gradient", &mut self.picture_gradient)
            .push(&params)
            .dispatch_over_3d(invocations);
    }

    /// Records the derivatives of the loss by the splats and their colours, after [`Picture::compare`].
    pub fn differentiate(&mut self, recorder: &mut Recorder, of: &Splats<'_>, shot: &Shot) {
        let tiles = self.tiles();
        recorder
            .pass(&self.blend_grad)
            .read("starts", &self.pairs.starts)
            .read("pairs", self.pairs.values(self.tile_bits))
            .read("pair_splats", &self.pair_splats)
            .read("picture_splats", &self.seen)
            .read("picture", &self.colours)
            .read("ends", &self.ends)
            .read("picture_gradient", &self.picture_gradient)
            .write("moments", &mut self.moments)
            .push(&PictureBlendGradParams { size: self.size })
            .dispatch(tiles);
        let params = self.params(shot);
        recorder
            .pass(&self.project_grad)
            .read("splats", of.splats)
            .read("harmonics_of", of.harmonics)
            .read("picture_splats", &self.seen)
            .read("order", self.sort.sorted_values(DEPTH_BITS))
            .read("pair_offsets", &self.pairs.offsets)
            .read("moments", &self.moments)
            .write("gradients", &mut self.rows)
            .write("harmonic_gradients", &mut self.harmonic_rows)
            .push(&params)
            .dispatch_over(self.splat_count as u32);
    }

    /// Records one step of Adam for the harmonics.
    pub fn step_harmonics(
        &self,
        recorder: &mut Recorder,
        state: &mut HarmonicsState,
        params: &AdamHarmonicsParams,
    ) {
        recorder
            .pass(&self.adam)
            .read("harmonic_gradients", &self.harmonic_rows)
            .write("harmonics_of", &mut state.harmonics)
            .write("first_moments", &mut state.first)
            .write("second_moments", &mut state.second)
            .read("pair_totals", &self.pair_totals)
            .push(params)
            .dispatch_over(params.splat_count);
    }

    /// Returns the mean absolute error and the mean SSIM of the picture that was compared last, over pixels and
    /// channels. Waits for the device.
    pub fn losses(&self) -> Result<[f64; 2]> {
        let mut sums = [0.0; 2];
        for tile in self.losses.read()? {
            sums[0] += f64::from(tile[0]);
            sums[1] += f64::from(tile[1]);
        }
        let count = 3.0 * f64::from(self.size[0]) * f64::from(self.size[1]);
        Ok(sums.map(|sum| sum / count))
    }
}
