//! The structs that host and shaders share, in `scalar` layout: plain arrays, no SIMD types, no padding.

use bytemuck::{Pod, Zeroable};

/// Number of patches along each edge of a picture, each hidden by the lens or not.
pub const PATCHES: usize = crate::visibility::PATCHES as usize;
/// Number of words that hold the patches of a picture, a bit each: two words for a row, rows from the top,
/// the lowest bit at the left.
pub const PATCH_WORDS: usize = PATCHES * PATCHES / 32;

/// One splat by its raw parameters: 12 floats, 48 bytes. Spaces and units depend on the set that holds it:
/// voxel space inside a fit, world mm relative to the set's origin in a file.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Splat {
    /// Centre.
    pub mean: [f32; 3],
    /// Opacity α = 1 / (1 + exp(-logit)).
    pub opacity_logit: f32,
    /// Unit quaternion, (w, x, y, z).
    pub rotation: [f32; 4],
    /// Natural logarithm of the standard deviation along each of the rotated axes.
    pub log_scale: [f32; 3],
    /// Physical intensity, HU for CT.
    pub intensity: f32,
}

macro_rules! shared {
    ($($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $ty:ty,)* })*) => {$(
        $(#[$doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
        pub struct $name { $($(#[$field_doc])* pub $field: $ty,)* }
    )*};
}

mod picture;

pub use picture::{
    AdamHarmonicsParams, PictureBlendGradParams, PictureBlendParams, PictureLossParams, PicturePairParams,
    PictureProjectParams, PictureSplat,
};

shared! {
    /// The part of a splat that rasterization needs; see `include/splat.glsl`.
    Footprint {
        /// Centre, voxels in the brick grid.
        mean: [f32; 3],
        /// Amplitude a of the weight w = a κ(q): the opacity α times the peak of the kernel.
        amplitude: f32,
        /// First row of the triangular whitening matrix.
        t_x: [f32; 3],
        /// Intensity relative to the background, in units of the fit.
        intensity: f32,
        /// Second row, without its zero.
        t_y: [f32; 2],
        /// Third row, without its zeros.
        t_z: f32,
        /// Half size of the box around the support, voxels.
        extent: [f32; 3],
    }
    /// dL/d(parameter) of one splat; also a row of Adam's moments.
    SplatGrad {
        /// Derivative by the centre.
        mean: [f32; 3],
        /// Derivative by the opacity logit.
        opacity_logit: f32,
        /// Derivative by a small rotation about each of the splat's own axes, radians.
        rotation: [f32; 3],
        /// Derivative by the logarithm of each scale.
        log_scale: [f32; 3],
        /// Derivative by the intensity.
        intensity: f32,
    }
    /// The history that a fit keeps of a splat besides Adam's moments.
    History {
        /// Σ |dL/dμ| since the last change of the splats.
        gradient_norm: f32,
        /// Upper bound of each log scale.
        log_scale_cap: f32,
    }
    /// The samples of a chunk.
    Grid {
        /// Bricks along x, y, z.
        bricks: [u32; 3],
        /// First slot of the chunk.
        first_slot: u32,
        /// Displacement of the samples from the voxel centres, voxels.
        offset: [f32; 3],
        /// Number of slots in the chunk.
        slot_count: u32,
    }
    /// Σw and V̂ (relative to the background) of one sample.
    Reconstruction {
        /// Σw.
        weight: f32,
        /// V̂ - background, in units of the fit.
        value: f32,
    }
    /// dL/dV̂ and dL/dW of one sample.
    Adjoint {
        /// dL/dV̂, then A.
        value: f32,
        /// dL/dW, then H.
        weight: f32,
    }
    /// Push constants of the prefix sum.
    ScanParams {
        /// Number of elements.
        count: u32,
    }
    /// Push constants of the radix sort.
    RadixParams {
        /// First bit of the digit.
        shift: u32,
        /// Number of blocks in the digit table.
        blocks: u32,
        /// Index of the count that is the number of keys.
        count_index: u32,
        /// Greatest number of keys.
        capacity: u32,
    }
    /// Push constants of `gather_rows` and `scatter_rows`.
    RowParams {
        /// Number of rows.
        count: u32,
        /// Number of words of a row.
        words: u32,
        /// First index that is used.
        first: u32,
    }
    /// Push constants of `splat_bounds` and `emit_pairs`.
    SplatParams {
        /// Sample grid.
        grid: Grid,
        /// Number of splats.
        splat_count: u32,
        /// Number of pairs that fit the buffers.
        capacity: u32,
        /// Voxels along each axis per unit of the space in which splats have their shape; ones for voxel
        /// space.
        stretch: [f32; 3],
    }
    /// Push constants of `brick_ranges`.
    RangeParams {
        /// Number of slots of the chunk.
        slot_count: u32,
        /// Index of the count that is the number of pairs.
        count_index: u32,
        /// Greatest number of pairs.
        capacity: u32,
    }
    /// Push constants of `pair_masks`.
    PairParams {
        /// Sample grid.
        grid: Grid,
        /// Index of the count that is the number of pairs.
        count_index: u32,
        /// Greatest number of pairs.
        capacity: u32,
    }
    /// Push constants of `splat_to_volume`.
    RasterParams {
        /// Sample grid.
        grid: Grid,
        /// First cell of this dispatch.
        first_cell: u32,
        /// ε of equation (2).
        epsilon: f32,
    }
    /// Push constants of every loss term.
    LossParams {
        /// λ of the term.
        weight: f32,
        /// Further parameter of the term.
        parameter: f32,
        /// ε of equation (2).
        epsilon: f32,
        /// Threshold: a sample is in the region if the mask exceeds it; below 0 the term uses the mask
        /// itself.
        region: f32,
        /// The lower end of the intensity range, relative to the background in units of the fit.
        low: f32,
        /// An error of the occupancy up to this costs nothing.
        tolerance: f32,
    }
    /// Push constants of `overlap_sums`.
    OverlapParams {
        /// First slot of the chunk.
        first_slot: u32,
        /// Threshold of [`LossParams`].
        region: f32,
        /// Lower end of the range, as in [`LossParams`].
        low: f32,
    }
    /// Push constants of `sum_triples`.
    SumParams {
        /// Number of rows.
        count: u32,
    }
    /// Push constants of `splat_to_volume_grad`.
    GradParams {
        /// Sample grid.
        grid: Grid,
        /// First splat of this dispatch.
        first_splat: u32,
        /// Number of splats.
        splat_count: u32,
        /// 1 if the moments are added to those of former chunks.
        accumulate: u32,
    }
    /// Push constants of `moments_to_grad`.
    MomentParams {
        /// Number of splats.
        splat_count: u32,
        /// Voxels along each axis per unit, as in [`SplatParams`].
        stretch: [f32; 3],
    }
    /// Push constants of `adam`; see the kernel.
    AdamParams {
        /// Number of splats.
        splat_count: u32,
        /// Number of chunks of this step.
        chunk_count: u32,
        /// Number of pairs that fit the bins.
        capacity: u32,
        /// β₁.
        beta1: f32,
        /// β₂.
        beta2: f32,
        /// 1 / (1 - β₁ᵗ).
        correction1: f32,
        /// 1 / (1 - β₂ᵗ).
        correction2: f32,
        /// ε of Adam.
        epsilon: f32,
        /// Learning rate of the centre, voxels.
        rate_mean: [f32; 3],
        /// Learning rate of the rotation, radians.
        rate_rotation: f32,
        /// Learning rate of the natural logarithm of the scales.
        rate_log_scale: f32,
        /// Learning rate of the opacity logit.
        rate_opacity: f32,
        /// Learning rate of the intensity, units of the fit.
        rate_intensity: f32,
        /// Lower clamp of the log scales along each of the splat's own axes.
        min_log_scale: [f32; 3],
        /// Upper clamp of the log scales along each of the splat's own axes.
        max_log_scale: [f32; 3],
        /// λ of Σ |s|, s the three scales of a splat; 0 leaves it out.
        scale_weight: f32,
        /// Clamp of the opacity logit, both ways.
        max_logit: f32,
        /// Lower clamp of the intensity.
        min_intensity: f32,
        /// Upper clamp of the intensity.
        max_intensity: f32,
        /// Upper corner of the sample grid, voxels.
        max_mean: [f32; 3],
    }
    /// Ranges by which the rows of a chunk of packed splats are quantised; see `include/packed.glsl`.
    PackedChunk {
        /// Lower corner of the box of the means.
        low: [f32; 3],
        /// Least log scale of any axis.
        log_scale_low: f32,
        /// Upper corner of the box of the means.
        high: [f32; 3],
        /// Greatest log scale of any axis.
        log_scale_high: f32,
    }
    /// Ranges by which all rows of a packed set are quantised.
    PackedRange {
        /// Least opacity logit.
        logit_low: f32,
        /// Greatest opacity logit.
        logit_high: f32,
        /// Least intensity.
        intensity_low: f32,
        /// Greatest intensity.
        intensity_high: f32,
    }
    /// One eye. Eye space: x to the right, y up, z the distance along the viewing direction, mm.
    View {
        /// Position of the eye, mm in the space of the scene.
        eye: [f32; 3],
        /// Unit vector to the right of the picture.
        right: [f32; 3],
        /// Unit vector to the top of the picture.
        up: [f32; 3],
        /// Unit vector into the picture.
        forward: [f32; 3],
        /// x/z of the left and the right edge of the picture, y/z of the upper and the lower one.
        tangents: [f32; 4],
    }
    /// A look: a transfer function's table, the light and the clip planes. The first row is that of the scene, the
    /// others are of functions of objects, and only their tables count.
    Look {
        /// Intensity of the first entry of the table.
        first: f32,
        /// Entries per unit of intensity.
        inverse_step: f32,
        /// Index of the last entry.
        last: f32,
        /// Unit of the integrals.
        integral_unit: f32,
        /// v0 of the shaded gradient: the lower end of what is visible.
        dark: f32,
        /// Share of the colour that needs no light.
        ambient: f32,
        /// Share of the colour that follows the angle to the light.
        diffuse: f32,
        /// Strength of the highlight.
        specular: f32,
        /// Exponent of the highlight.
        power: f32,
        /// Share of the light that is lost where all around is opaque.
        occlusion: f32,
        /// Entries of the table over the gradient magnitude, per unit of intensity over a mean edge of a voxel.
        inverse_gradient_step: f32,
        /// Number of planes in use.
        plane_count: u32,
        /// Index of the table's first entry among those of all functions.
        offset: u32,
        /// Unit vector towards the key light: in eye space, or in the space of the scene.
        light: [f32; 3],
        /// Share of the light that comes from the fill light.
        fill: f32,
        /// 1 if the light is fixed to the scene, 0 if to the eye.
        light_turns: u32,
        /// Clip planes: points with n · x + d < 0 are cut away; x in mm in the space of the scene.
        planes: [[f32; 4]; crate::look_row::CLIP_PLANES as usize],
    }
    /// Appearance of an object of a scene; see `include/appearance.glsl`.
    Appearance {
        /// A colour, and the share of the transfer function's colour that it replaces, 0 or 1; zeros if there
        /// is none.
        tint: [f32; 4],
        /// Factor of the occupancy.
        opacity: f32,
        /// 0 if its splats are left out.
        visible: u32,
        /// Row of its transfer function.
        function: u32,
    }
    /// The tiles of a picture and the slabs along the depth of a scene; see `include/tiles.glsl`.
    TileGrid {
        /// Width and height of the picture, pixels.
        size: [u32; 2],
        /// Number of tiles along width and height.
        tiles: [u32; 2],
        /// Centre of a ball around the scene, mm.
        centre: [f32; 3],
        /// Radius of that ball, mm.
        radius: f32,
        /// Distance of the planes, mm.
        spacing: f32,
        /// Number of planes of a block.
        planes: u32,
        /// Number of blocks along the depth.
        blocks: u32,
        /// Number of rows of splats of one view.
        splat_count: u32,
        /// Number of pairs that fit the buffers.
        capacity: u32,
    }
    /// Push constants of `hidden_parts`.
    HiddenParams {
        /// Width and height of the picture, pixels.
        size: [u32; 2],
        /// Number of tiles along width and height.
        tiles: [u32; 2],
    }
    /// Push constants of `project_splats`.
    ProjectParams {
        /// Tiles and planes.
        grid: TileGrid,
        /// Ranges of packed rows.
        range: PackedRange,
        /// Background b of the field.
        background: f32,
    }
    /// Push constants of `emit_tile_pairs`.
    EmitParams {
        /// Tiles and planes.
        grid: TileGrid,
    }
    /// Push constants of `slab`.
    SlabParams {
        /// Tiles and planes.
        grid: TileGrid,
        /// Background b of the field.
        background: f32,
        /// ε of the field.
        epsilon: f32,
        /// w0 of the occupancy.
        occupancy_w0: f32,
        /// Least light: rays end when less than this would pass.
        dark: f32,
        /// First row of tiles.
        first_row: u32,
    }
    /// Push constants of `mark_active`.
    ActivityParams {
        /// Number of splats.
        count: u32,
    }
    /// Push constants of `list_active`.
    ListParams {
        /// Number of splats.
        count: u32,
    }
    /// Push constants of `limit_active`.
    LimitParams {
        /// Number of splats.
        count: u32,
        /// Greatest number of splats that stay.
        budget: u32,
    }
    /// A volume in an image, and its bricks; see `include/bricks.glsl`.
    BrickGrid {
        /// Voxels of the image.
        texels: [u32; 3],
        /// Bricks along x, y, z.
        bricks: [u32; 3],
        /// Logarithm to base 2 of the edges of a brick, voxels.
        shift: [u32; 3],
    }
    /// Push constants of `occupancy_mark`.
    OccupancyParams {
        /// Number of bricks.
        count: u32,
        /// Distance of a brick that cannot be seen.
        most: u32,
    }
    /// Push constants of `occupancy_spread`.
    SpreadParams {
        /// The bricks.
        grid: BrickGrid,
        /// Axis along which distances are spread.
        axis: u32,
    }
    /// Push constants of `voxel_gradients`.
    VoxelGradientParams {
        /// The image and its bricks.
        grid: BrickGrid,
        /// v₀ as a fraction.
        dark: f32,
        /// Factor of the gradients.
        unit: f32,
    }
    /// Push constants of `raymarch`.
    RaymarchParams {
        /// The image and its bricks.
        grid: BrickGrid,
        /// Rows of the affine from the scene, mm, to voxels of the image.
        voxel_from_scene: [[f32; 4]; 3],
        /// Intensity that the fraction 0 stands for.
        first: f32,
        /// Difference of intensity between the fractions 0 and 1.
        span: f32,
        /// Width and height of the picture, pixels.
        size: [u32; 2],
        /// Length of a cell, mm.
        cell: f32,
        /// Number of parts into which a cell is cut where something can show.
        parts: u32,
        /// How far beyond the intensities at its ends a cell can reach.
        slack: f32,
        /// Least light: rays end when less than this would pass.
        dark: f32,
        /// Mean edge of the voxels of the CT, mm, over which gradient magnitudes are; times the intensity that
        /// 1 of a kept gradient stands for.
        edge: f32,
    }
    /// Push constants of `mark_faces`.
    MarkParams {
        /// The image and its bricks.
        grid: BrickGrid,
        /// Rows of the affine from the scene, mm, to voxels of the image.
        voxel_from_scene: [[f32; 4]; 3],
        /// Width and height of the picture, pixels.
        size: [u32; 2],
    }
    /// Push constants of `list_faces`.
    FacesParams {
        /// The bricks.
        grid: BrickGrid,
    }
    /// A splat as one eye sees it; see `include/projected.glsl`.
    Projected {
        /// x/z and y/z of its centre.
        centre: [f32; 2],
        /// z of its centre, mm.
        depth: f32,
        /// Half of the depth that its support spans, mm.
        reach: f32,
        /// Row of the triangular whitening that contains the depth: by relative depth, x/z, y/z.
        along: [f32; 3],
        /// Elements of the rows without the depth.
        across: [f32; 3],
        /// Amplitude a of the weight.
        amplitude: f32,
        /// Intensity relative to the background.
        intensity: f32,
    }
    /// The gradients of the field at the centre of a splat, for its light.
    Centre {
        /// ∇(O V), 1/mm.
        slope: [f32; 3],
        /// ∇O, 1/mm.
        occupancy_slope: [f32; 3],
    }
    /// A splat as mode alpha draws it for one view; see `include/quad.glsl`.
    Quad {
        /// Centre of the ellipse, on a picture from -1 to 1 with y downwards.
        centre: [f32; 2],
        /// Axes that take the unit circle to the ellipse γ = 6: centre + (x u + y v, z v).
        axes: [f32; 3],
        /// Part of these axes at which the opacity ends; 0 if the splat is not seen.
        edge: f32,
        /// Optical depth through the centre; for standard splats the opacity.
        thickness: f32,
        /// z of the centre, mm.
        depth: f32,
        /// Colour, not premultiplied.
        colour: [f32; 3],
    }
    /// Push constants of `project_quads`.
    QuadParams {
        /// Width and height of the picture, pixels.
        size: [u32; 2],
        /// Centre of a ball around the scene, mm.
        centre: [f32; 3],
        /// Radius of that ball, mm.
        radius: f32,
        /// Number of views.
        view_count: u32,
        /// Number of splats, and of rows of quads of one view.
        splat_count: u32,
        /// Number of spherical harmonics of each colour of a standard splat.
        coefficients: u32,
        /// Ranges of packed rows.
        range: PackedRange,
    }
    /// Push constants of `deconvolve_points` and `deconvolve_splats`.
    DeconvolutionParams {
        /// Number of points, or of splats.
        count: u32,
        /// Number of the round; the first one, 0, begins with the medium itself.
        round: u32,
    }
    /// Push constants of `alpha`.
    AlphaParams {
        /// Number of rows of quads of one view.
        splat_count: u32,
    }
    /// Push constants of `show`.
    ShowParams {
        /// Width and height of the window, pixels.
        window: [f32; 2],
        /// Area that is covered: left, top, right, bottom, pixels.
        area: [f32; 4],
        /// Area of the picture: left, top, right, bottom, pixels.
        picture: [f32; 4],
        /// Background, display-referred and opaque.
        background: [f32; 4],
        /// Border: left of it is the first picture, from it on the second; pixels.
        split: f32,
        /// Layer of the first picture.
        first: u32,
        /// Layer of the second picture.
        second: u32,
        /// Edges of the part of the first picture that is shown, from its upper left corner, as parts of its
        /// own.
        first_part: [f32; 2],
        /// Edges of the part of the second picture that is shown, likewise.
        second_part: [f32; 2],
    }
    /// Push constants of `eyes`.
    EyesParams {
        /// Edges of the rendered part, as parts of the picture's.
        part: [f32; 2],
        /// Greatest texture coordinates at which a sample takes in only what was rendered.
        most: [f32; 2],
        /// Background, premultiplied and display-referred.
        background: [f32; 4],
        /// Distances along the viewing direction of depths 0 and 1, mm.
        range: [f32; 2],
        /// Left, upper, right and lower edge of the insets, as parts of the eyes' pictures.
        insets: [[f32; 4]; 2],
        /// Part of an inset's edges over which it fades.
        fading: f32,
        /// Middle and half-axes of the mark of a draft, as parts of the eyes' pictures; 0 if there is none.
        marks: [[f32; 4]; 2],
    }
    /// Push constants of `mirror`.
    MirrorParams {
        /// Width and height of the window, pixels.
        window: [f32; 2],
        /// Width and height of the picture of an eye, pixels.
        eye: [f32; 2],
        /// The layer that is shown, or the first of several.
        first: u32,
        /// Number of layers that are shown, side by side.
        count: u32,
    }
    /// Push constants of `sheets`.
    SheetsParams {
        /// Distances along the viewing direction of depths 0 and 1, mm.
        range: [f32; 2],
    }
    /// Push constants of `rods`.
    RodsParams {
        /// Distances along the viewing direction of depths 0 and 1, mm.
        range: [f32; 2],
    }
    /// A round body between two places, with a half sphere at each end.
    Rod {
        /// Middle of the first end, mm in the space of the scene.
        from: [f32; 3],
        /// Middle of the other end, likewise.
        to: [f32; 3],
        /// Radius of either end, mm.
        radii: [f32; 2],
        /// Colour, sRGB, a byte each, red lowest.
        colour: u32,
    }
    /// Push constants of `panels`.
    PanelParams {
        /// Width and height of the window, points.
        window: [f32; 2],
    }
    /// A rectangle of egui's screen on a plane in the room.
    Sheet {
        /// Clip rectangle, outside of which nothing is painted: left, top, right, bottom; points.
        clip: [f32; 4],
        /// Place of the screen's origin, mm in the space of the scene.
        zero: [f32; 3],
        /// Step of one point to the right, mm.
        right: [f32; 3],
        /// Step of one point down, mm.
        down: [f32; 3],
    }
    /// A corner of a triangle of the panels.
    PanelVertex {
        /// Position from the window's upper left corner, points.
        place: [f32; 2],
        /// Position in the texture, 0 to 1.
        texel: [f32; 2],
        /// Colour, premultiplied sRGB, a byte each, red lowest.
        colour: u32,
        /// Index of its clip rectangle.
        clip: u32,
    }
}

/// Wanted value and occupancy of a sample, as the loss kernels read them: two 16-bit signed fractions.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Target(u32);

impl Target {
    /// A sample that takes no part.
    pub const IDLE: Target = Target(0x8001_0000);

    /// Creates a target: `value` is V - background in spans of the intensity range, -1..1; `occupancy` is M
    /// in 0..1. Rounds to the nearest of 2·32767 steps, and down half-way between two: 0 is exact, and M = ½
    /// does not come to lie above ½, where a sample would count as inside.
    pub fn new(value: f32, occupancy: f32) -> Self {
        let fraction = |v: f32| (v.clamp(-1.0, 1.0) * 32767.0 - 0.5).ceil() as i16 as u16;
        Target(u32::from(fraction(value)) | u32::from(fraction(occupancy.max(0.0))) << 16)
    }

    /// Returns V - background in spans of the intensity range.
    pub fn value(self) -> f32 {
        f32::from(self.0 as u16 as i16) / 32767.0
    }

    /// Returns M; negative if the sample takes no part.
    pub fn occupancy(self) -> f32 {
        f32::from((self.0 >> 16) as u16 as i16) / 32767.0
    }
}
