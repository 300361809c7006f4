//! What splats are moved by.

use shaders_glsl::types::SplatGrad;

use base::error::Result;
use gpu::{Buffer, Recorder};

/// A loss of splats with its derivatives, on the device: an error in voxels, or of a picture. [`Adam`](super::Adam) moves
/// the splats by them.
pub trait Objective {
    /// The splats as the loss needs them.
    type Splats<'a>;

    /// Records the loss of the splats in step `turn`, counted from 0, and its derivatives.
    ///
    /// # Errors
    /// Those of the device.
    fn record(&mut self, recorder: &mut Recorder, splats: &Self::Splats<'_>, turn: u32) -> Result<()>;

    /// Returns dL/d(parameters), one row a splat, as the last step left it.
    fn gradients(&self) -> &Buffer<SplatGrad>;

    /// Returns how many pairs of a splat and a place the last steps needed. If one of them needed more than
    /// [`Objective::capacity`], Adam moves nothing, and the step must be done again after [`Objective::grow`].
    fn pair_totals(&self) -> &Buffer<u32>;

    /// Returns how many pairs the buffers hold.
    fn capacity(&self) -> usize;

    /// Makes room for `pairs` pairs. Nothing may be in flight.
    ///
    /// # Errors
    /// Those of buffers that this device cannot have.
    fn grow(&mut self, pairs: usize) -> Result<()>;
}
