//! The GLSL kernels of vgs and the structs they share with the host.
#![forbid(unsafe_code)]

pub mod types;
