//! What a frame of splats is made of, counted where it is made: sizes of lists that are on the device anyway.
//! What is done for each pixel is counted by the shaders themselves, in a run of its own
//! ([`crate::render::Settings::counting`]).

/// Counts of the frame that was rendered last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Invocations that the kernels which own a splat were started for: those of all splats, and in mode slab
    /// of all views.
    pub rows: u64,
    /// Those of them whose splat the look can show.
    pub shown: u64,
    /// Tiles in the boxes around the splats' outlines, each of which is looked at; mode slab.
    pub tiles: u64,
    /// Pairs of a splat and a (tile, block), or splats, that are sorted.
    pub sorted: u64,
    /// Most that could have been: what is not sorted still starts its workgroups.
    pub room: u64,
    /// Passes of the sort.
    pub digits: u64,
    /// Entries of its table of digits, in each pass.
    pub table: u64,
    /// (View, tile, block)s; mode slab.
    pub lists: u64,
    /// Splats that are drawn, each in every view; mode alpha.
    pub quads: u64,
}
