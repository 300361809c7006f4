//! What kernels are meant to compute, written plainly for the host. Never touches the GPU.

pub mod raymarch;
