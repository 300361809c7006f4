//! The JSON of a glTF file, as far as it says where splats are.

use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;

use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;

use super::{FLOAT, NAME, UNSIGNED_BYTE};
use base::error::{Error, Kind, Result};

/// Most primitives of splats that are read, each counted as often as nodes show it.
const MOST_INSTANCES: usize = 1 << 16;

/// Greatest distance from one row of an attribute to the next that glTF allows, bytes.
const LONGEST_STRIDE: u64 = 252;
/// Bytes of an attribute that are read at a time.
const BLOCK: u64 = 64 * 1024;

pub(super) fn damaged(what: impl Into<String>) -> Error {
    Error::new(Kind::BadData, "VGS-GLB-001", what)
        .help("the file is damaged or cut off: get it again from where it was made")
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Document {
    #[serde(default)]
    pub extensions_required: Vec<String>,
    pub scene: Option<usize>,
    #[serde(default)]
    pub scenes: Vec<Scene>,
    #[serde(default)]
    pub nodes: Vec<Node>,
    #[serde(default)]
    pub meshes: Vec<Mesh>,
    #[serde(default)]
    pub accessors: Vec<Accessor>,
    #[serde(default)]
    pub buffer_views: Vec<View>,
    #[serde(default)]
    pub buffers: Vec<Buffer>,
}

#[derive(Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub nodes: Vec<usize>,
}

#[derive(Deserialize)]
pub(super) struct Node {
    mesh: Option<usize>,
    #[serde(default)]
    children: Vec<usize>,
    matrix: Option<Box<[f64; 16]>>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

impl Node {
    /// Returns the map from the node to its parent.
    fn affine(&self) -> DAffine3 {
        match &self.matrix {
            Some(columns) => DAffine3::from_mat4(DMat4::from_cols_array(columns)),
            None => DAffine3::from_scale_rotation_translation(
                DVec3::from_array(self.scale.unwrap_or([1.0; 3])),
                DQuat::from_array(self.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0])),
                DVec3::from_array(self.translation.unwrap_or_default()),
            ),
        }
    }
}

#[derive(Deserialize)]
pub(super) struct Mesh {
    #[serde(default)]
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
pub(super) struct Primitive {
    pub attributes: BTreeMap<String, usize>,
    extensions: Option<Extensions>,
    pub extras: Option<Value>,
}

#[derive(Deserialize)]
struct Extensions {
    #[serde(rename = "KHR_gaussian_splatting")]
    splatting: Option<Splatting>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Splatting {
    pub kernel: Option<String>,
    pub color_space: Option<String>,
    /// Extensions of the extension, such as those that pack the splats.
    pub extensions: Option<BTreeMap<String, IgnoredAny>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: u64,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: u64,
    #[serde(rename = "type")]
    shape: String,
    sparse: Option<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: Option<u64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    uri: Option<IgnoredAny>,
    byte_length: u64,
}

/// Splats of a mesh at the place of a node.
pub(super) struct Instance<'a> {
    pub primitive: &'a Primitive,
    pub splatting: &'a Splatting,
    /// The map from the mesh to the world of the file, metres.
    pub affine: DAffine3,
}

impl Document {
    /// Returns the splats of the scene.
    pub fn instances(&self) -> Result<Vec<Instance<'_>>> {
        let roots = match self.scenes.get(self.scene.unwrap_or(0)) {
            Some(scene) => scene.nodes.clone(),
            None if self.scene.is_some() => return Err(damaged("the scene that is named is not there")),
            // Without scenes all nodes are shown that are no children.
            None => {
                let mut root = vec![true; self.nodes.len()];
                for &child in self.nodes.iter().flat_map(|node| &node.children) {
                    if let Some(root) = root.get_mut(child) {
                        *root = false;
                    }
                }
                (0..self.nodes.len()).filter(|&i| root[i]).collect()
            }
        };
        let mut open: Vec<(usize, DAffine3)> =
            roots.into_iter().rev().map(|i| (i, DAffine3::IDENTITY)).collect();
        let mut seen = vec![false; self.nodes.len()];
        let mut found = Vec::new();
        while let Some((index, parent)) = open.pop() {
            let Some(node) = self.nodes.get(index) else {
                return Err(damaged(format!("node {index} is not there")));
            };
            if std::mem::replace(&mut seen[index], true) {
                return Err(damaged(format!("node {index} has two places in the tree of nodes")));
            }
            let affine = parent * node.affine();
            open.extend(node.children.iter().rev().map(|&child| (child, affine)));
            let Some(mesh) = node.mesh else { continue };
            let Some(mesh) = self.meshes.get(mesh) else {
                return Err(damaged(format!("mesh {mesh} is not there")));
            };
            for primitive in &mesh.primitives {
                if let Some(splatting) = primitive.extensions.as_ref().and_then(|e| e.splatting.as_ref()) {
                    if found.len() == MOST_INSTANCES {
                        let message = format!("more than {MOST_INSTANCES} groups of splats");
                        return Err(Error::new(Kind::BadData, "VGS-GLB-007", message)
                            .help("write the splats as one primitive, with the program that it is from"));
                    }
                    found.push(Instance { primitive, splatting, affine });
                }
            }
        }
        Ok(found)
    }

    /// Returns the numbers of an attribute, of which each row has `components`; `binary` are the bytes of the file
    /// that hold the buffer.
    pub fn numbers(
        &self,
        binary: &Range<u64>,
        attribute: (&str, usize),
        components: usize,
    ) -> Result<Numbers> {
        let (name, index) = attribute;
        let wrong = |what: String| damaged(format!("attribute {name}: {what}"));
        let Some(accessor) = self.accessors.get(index) else {
            return Err(wrong(format!("accessor {index} is not there")));
        };
        let shape = ["SCALAR", "VEC2", "VEC3", "VEC4"][components - 1];
        if accessor.shape != shape {
            return Err(wrong(format!("its type is {:?}, {shape} was expected", accessor.shape)));
        }
        let Some(component) = Component::of(accessor.component_type) else {
            return Err(wrong(format!("numbers of the type {}", accessor.component_type)));
        };
        let Some(view) = accessor.buffer_view.filter(|_| accessor.sparse.is_none()) else {
            let message = format!("attribute {name} is sparse, which is not read");
            return Err(Error::new(Kind::BadData, "VGS-GLB-004", message)
                .help("write it with plain accessors, with the program that it is from"));
        };
        let within = self.view(binary, view).map_err(&wrong)?;
        let row = component.bytes() * components as u64;
        let stride = self.buffer_views[view].byte_stride.unwrap_or(row);
        if !(row..=LONGEST_STRIDE).contains(&stride) {
            return Err(wrong(format!("rows of {row} bytes that are {stride} bytes apart")));
        }
        let first = within.start.saturating_add(accessor.byte_offset);
        let rows = accessor.count.saturating_sub(1).saturating_mul(stride);
        if accessor.count > 0 && first.saturating_add(rows).saturating_add(row) > within.end {
            return Err(wrong(format!("{} rows do not fit into their part of the file", accessor.count)));
        }
        let count = accessor.count as usize;
        Ok(Numbers { first, stride, row, count, components, component, normalized: accessor.normalized })
    }

    /// Returns the bytes of the file that a buffer view stands for, or why there are none.
    pub fn view(&self, binary: &Range<u64>, index: usize) -> std::result::Result<Range<u64>, String> {
        let view = self.buffer_views.get(index).ok_or_else(|| format!("buffer view {index} is not there"))?;
        let buffer = self.buffers.get(view.buffer).filter(|buffer| view.buffer == 0 && buffer.uri.is_none());
        let buffer = buffer.ok_or("it lies in another file, which is not read")?;
        let end = view.byte_offset.saturating_add(view.byte_length);
        if end > buffer.byte_length.min(binary.end - binary.start) {
            return Err(format!("buffer view {index} ends behind the end of the file"));
        }
        Ok(binary.start + view.byte_offset..binary.start + end)
    }
}

/// Type of numbers.
#[derive(Clone, Copy)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(number: u32) -> Option<Self> {
        Some(match number {
            5120 => Component::I8,
            UNSIGNED_BYTE => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            FLOAT => Component::F32,
            _ => return None,
        })
    }

    fn bytes(self) -> u64 {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// Returns the number of these bytes; −1 to 1 stand for a whole type that is normalized.
    fn value(self, b: &[u8], normalized: bool) -> f32 {
        let (value, most) = match self {
            Component::I8 => (f32::from(b[0] as i8), 127.0),
            Component::U8 => (f32::from(b[0]), 255.0),
            Component::I16 => (f32::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
            Component::U16 => (f32::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
            Component::U32 => (u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32, u32::MAX as f32),
            Component::F32 => return f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        };
        if normalized { (value / most).max(-1.0) } else { value }
    }
}

/// Numbers of an attribute in a file.
pub(super) struct Numbers {
    /// Where the first row is in the file, bytes.
    first: u64,
    stride: u64,
    /// Bytes of a row.
    row: u64,
    /// Number of rows.
    pub count: usize,
    components: usize,
    component: Component,
    normalized: bool,
}

impl Numbers {
    /// Passes each row to `each`; numbers that it has not are 0.
    pub fn read(
        &self,
        source: &mut (impl Read + Seek),
        mut each: impl FnMut(usize, [f32; 4]),
    ) -> std::io::Result<()> {
        let rows = (BLOCK / self.stride) as usize;
        let mut block = vec![0; rows * self.stride as usize];
        source.seek(SeekFrom::Start(self.first))?;
        for first in (0..self.count).step_by(rows) {
            let rows = rows.min(self.count - first);
            // The last row of all may end where the file does.
            let last = first + rows == self.count;
            let bytes = rows as u64 * self.stride - if last { self.stride - self.row } else { 0 };
            let block = &mut block[..bytes as usize];
            source.read_exact(block)?;
            let size = self.component.bytes() as usize;
            for (i, row) in block.chunks(self.stride as usize).enumerate() {
                let mut values = [0.0; 4];
                for (value, bytes) in values.iter_mut().zip(row.chunks_exact(size)).take(self.components) {
                    *value = self.component.value(bytes, self.normalized);
                }
                each(first + i, values);
            }
        }
        Ok(())
    }
}

/// Returns what an extension of [`NAME`] has done to the splats, if their attributes are not there.
pub(super) fn packing(splatting: &Splatting) -> Option<&str> {
    splatting.extensions.iter().flatten().map(|(name, _)| name.as_str()).find(|name| name.starts_with(NAME))
}
