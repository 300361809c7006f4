//! The GLSL kernels of vgs, compiled and reflected when this crate is built, and the structs they share with the
//! host. Adding a kernel is adding its `.comp` file to a folder; its [`Shader`] appears in [`ALL`].
#![forbid(unsafe_code)]

pub mod types;

/// What a kernel does with a bound buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// `readonly` in the shader.
    Read,
    /// `writeonly` in the shader.
    Write,
    /// Neither: old contents are read and changed.
    ReadWrite,
}

/// One storage buffer of a kernel, by its place in [`Shader::bindings`].
#[derive(Clone, Copy, Debug)]
pub struct Binding {
    /// Name of the array in the shader.
    pub name: &'static str,
    /// What the kernel does with it.
    pub access: Access,
    /// Bytes from one element to the next.
    pub stride: usize,
}

/// A compiled compute kernel and what reflection found in it.
#[derive(Debug)]
pub struct Shader {
    /// File name without ending.
    pub name: &'static str,
    /// Optimised SPIR-V, little endian.
    pub spirv: &'static [u8],
    /// Storage buffers of set 0, in binding order.
    pub bindings: &'static [Binding],
    /// Names of the specialisation constants, by id.
    pub constants: &'static [&'static str],
    /// Bytes of push constants; 0 when there are none.
    pub push_bytes: usize,
}

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
