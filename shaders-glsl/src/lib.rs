//! The GLSL shaders of vgs, compiled and reflected when this crate is built, and the structs and constants
//! they share with the host. Adding a kernel is adding its `.comp` file to a folder; its [`Shader`] appears
//! in [`KERNELS`]. Vertex and fragment shaders come in pairs of one name: `alpha.vert` and `alpha.frag` are
//! `ALPHA_VERT` and `ALPHA_FRAG`. A line `const uint TILE = 16;` of `include/tiles.glsl` is [`tiles::TILE`]
//! here: such a number is written in GLSL only.
#![forbid(unsafe_code)]

pub use shader_interface::types;

/// Access of a kernel to a bound resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// `readonly` in the shader.
    Read,
    /// `writeonly` in the shader.
    Write,
    /// Neither: old contents are read and changed.
    ReadWrite,
}

/// Kind of a bound resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resource {
    /// A storage buffer that holds one array.
    Buffer {
        /// Bytes from one element to the next.
        stride: usize,
    },
    /// An image with a sampler.
    Texture,
    /// A storage image.
    Image,
}

/// One resource of a shader.
#[derive(Clone, Copy, Debug)]
pub struct Binding {
    /// Its number in set 0.
    pub number: u32,
    /// Name of the array or the image in the shader.
    pub name: &'static str,
    /// Access of the shader.
    pub access: Access,
    /// Kind of the resource.
    pub resource: Resource,
}

/// Stage of the pipeline in which a shader runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// `.comp`: a kernel.
    Compute,
    /// `.vert`
    Vertex,
    /// `.frag`
    Fragment,
}

/// A compiled shader and what reflection found in it.
#[derive(Debug)]
pub struct Shader {
    /// File name without ending.
    pub name: &'static str,
    /// Stage, from the ending.
    pub stage: Stage,
    /// Folder of the file.
    pub folder: &'static str,
    /// Optimised SPIR-V, little endian.
    pub spirv: &'static [u8],
    /// Resources of set 0, in binding order.
    pub bindings: &'static [Binding],
    /// Names of the specialisation constants, by id.
    pub constants: &'static [&'static str],
    /// Bytes of push constants; 0 when there are none.
    pub push_bytes: usize,
    /// Invocations of a workgroup along x, y and z; `None` if a specialisation constant says how many, and
    /// for shaders that are not kernels.
    pub workgroup: Option<[u32; 3]>,
}

impl Shader {
    /// Returns the number of invocations of a workgroup along x.
    ///
    /// # Panics
    /// If a specialisation constant says how many there are.
    pub const fn width(&self) -> u32 {
        match self.workgroup {
            Some([x, _, _]) => x,
            None => panic!("a specialisation constant says how wide its workgroups are"),
        }
    }
}

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
