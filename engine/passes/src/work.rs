//! The work of a frame of splats, counted where it is done: sizes of lists that are on the device anyway. The
//! shaders themselves count the work of each pixel, in a run of its own
//! ([`render::Settings::counting`]).

/// Counts of the frame that was rendered last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Invocations of the kernels that own a splat: one for each splat, and in mode slab for each view of it.
    pub rows: u64,
    /// Invocations whose splat the look can show.
    pub shown: u64,
    /// Tiles in the boxes around the splats' outlines, each of which is tested; mode slab.
    pub tiles: u64,
    /// Pairs of a splat and a (tile, block), or splats, that are sorted.
    pub sorted: u64,
    /// Greatest number that could be sorted: pairs that are not there still start their workgroups.
    pub room: u64,
    /// Passes of the sort.
    pub digits: u64,
    /// Entries of the sort's table of digits, in each pass.
    pub table: u64,
    /// (View, tile, block) lists; mode slab.
    pub lists: u64,
    /// Splats that are drawn, each in every view; mode alpha.
    pub quads: u64,
    /// Bytes of the images of intensities, occupancies and gradients; modes volume and decoded.
    pub image_bytes: u64,
}
