//! The width of the workgroups of the forward and the backward pass.

use gpu::Gpu;

/// The width of the workgroups of the forward and the backward pass; the value is the number of their
/// invocations. Eight invocations own a cell or a splat. The result has the same bits in either shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum WorkgroupShape {
    /// One cell or splat at a time, so that all its loads are uniform, for CPU drivers.
    OneByOne = 8,
    /// Eight cells or splats side by side, for GPUs, which need full subgroups.
    SideBySide = 64,
}

impl WorkgroupShape {
    /// Returns the shape that suits a device: one at a time if 8 invocations fill a subgroup.
    pub fn of(gpu: &Gpu) -> Self {
        if gpu.description().subgroup_size <= 8 {
            WorkgroupShape::OneByOne
        } else {
            WorkgroupShape::SideBySide
        }
    }
}
