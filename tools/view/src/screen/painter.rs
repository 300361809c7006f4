//! Paints egui's panels over a picture: all triangles of a texture in one draw, from buffers that grow as
//! needed.
//!
//! The crate egui-ash-renderer does the same; it allocates memory that the engine does not count, waits for
//! the queue at every change of a texture, and starts partial uploads from an undefined layout.

use std::collections::HashMap;
use std::ops::Range;

use egui::epaint::{ClippedPrimitive, ImageData, ImageDelta, Primitive};
use egui::{Rect, TextureId, TexturesDelta};
use engine::gpu::{Buffer, Drawing, Format, Gpu, Image, Recorder, UploadRing};
use engine::{Error, Kind, Result};
use shaders_glsl as glsl;
use shaders_glsl::types::{PanelParams, PanelVertex};

/// Paints panels into pictures of one format.
pub struct Painter {
    gpu: Gpu,
    drawing: Drawing,
    textures: Textures,
    blank: Image,
    vertices: Buffer<PanelVertex>,
    indices: Buffer<u32>,
    clips: Buffer<[f32; 4]>,
}

/// Panels of a frame, from egui.
pub struct Painting<'a> {
    /// Triangles in painting order.
    pub primitives: &'a [ClippedPrimitive],
    /// Width and height of the window, points.
    pub points: [f32; 2],
}

/// All triangles, as the shader takes them.
#[derive(Default)]
pub struct Mesh {
    /// Corners; each has the index of its row of `clips`.
    pub vertices: Vec<PanelVertex>,
    /// Indices of corners, three for each triangle.
    pub indices: Vec<u32>,
    /// Rectangles outside of which nothing is painted: left, top, right, bottom; points.
    pub clips: Vec<[f32; 4]>,
    /// Ranges of indices that share a texture, in painting order.
    pub runs: Vec<(TextureId, Range<u32>)>,
}

/// egui's textures on the device.
pub struct Textures {
    gpu: Gpu,
    pictures: HashMap<TextureId, Image>,
    ring: UploadRing,
}

/// Pieces of memory through which changes of textures go, and the bytes of each: letters that are drawn for the first time.
const PIECES: (usize, usize) = (3, 1 << 18);

impl Textures {
    /// Creates an empty set of textures.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let ring = UploadRing::new(gpu, "panel textures on their way", PIECES.0, PIECES.1)?;
        Ok(Textures { gpu: gpu.clone(), pictures: HashMap::new(), ring })
    }

    /// Returns the texture with this name, if it exists.
    pub fn get(&self, id: TextureId) -> Option<&Image> {
        self.pictures.get(&id)
    }

    /// Records the changes of textures. Those that egui frees are kept until after the frame, see
    /// [`Textures::forget`].
    pub fn update(&mut self, recorder: &mut Recorder, changes: &mut TexturesDelta) -> Result<()> {
        if !changes.set.is_empty() {
            self.ring.begin()?;
        }
        for (id, deltas) in changes.set.drain() {
            for delta in deltas {
                self.write(recorder, id, &delta)?;
            }
        }
        Ok(())
    }

    fn write(&mut self, recorder: &mut Recorder, id: TextureId, delta: &ImageDelta) -> Result<()> {
        let ImageData::Color(image) = &delta.image;
        let size = image.size.map(|n| n as u32);
        let texels: Vec<[u8; 4]> = image.pixels.iter().map(|pixel| pixel.to_array()).collect();
        let corner = match delta.pos {
            Some(corner) => corner.map(|n| n as u32),
            None => {
                let texture = self.gpu.picture("panel texture", "panels", Format::Rgba8, size, 1)?;
                self.pictures.insert(id, texture);
                [0, 0]
            }
        };
        let texture = self.pictures.get_mut(&id).ok_or_else(|| {
            Error::new(Kind::Internal, "VGS-VIEW-090", format!("a change of the unknown texture {id:?}"))
        })?;
        self.ring.write_rectangle(recorder, &texels, texture, corner, size)
    }

    /// Drops textures that egui no longer needs; memory in flight is freed later.
    pub fn forget(&mut self, changes: &mut TexturesDelta) {
        for id in changes.free.drain() {
            self.pictures.remove(&id);
        }
    }
}

impl Painter {
    /// Creates a painter for pictures of this format.
    pub fn new(gpu: &Gpu, format: Format) -> Result<Self> {
        let linear = [u32::from(format.is_srgb())];
        Ok(Painter {
            gpu: gpu.clone(),
            drawing: Drawing::new(gpu, &glsl::PANELS_VERT, &glsl::PANELS_FRAG, &linear, &[format], 1)?,
            blank: gpu.picture("nothing", "panels", Format::Rgba8, [1, 1], 1)?,
            textures: Textures::new(gpu)?,
            vertices: gpu.mapped("panel vertices", "panels", 1)?,
            indices: gpu.mapped("panel indices", "panels", 1)?,
            clips: gpu.mapped("panel clip rectangles", "panels", 1)?,
        })
    }

    /// Returns an empty picture, to be shown if there is no other.
    pub fn blank(&self) -> &Image {
        &self.blank
    }

    /// Records the changes of textures, see [`Textures::update`].
    pub fn update(&mut self, recorder: &mut Recorder, changes: &mut TexturesDelta) -> Result<()> {
        self.textures.update(recorder, changes)
    }

    /// Drops textures that egui no longer needs, see [`Textures::forget`].
    pub fn forget(&mut self, changes: &mut TexturesDelta) {
        self.textures.forget(changes);
    }

    /// Records the panels over `picture`. No earlier painting may be in flight.
    pub fn paint(
        &mut self,
        recorder: &mut Recorder,
        painting: &Painting<'_>,
        picture: &mut Image,
    ) -> Result<()> {
        let mesh = Mesh::of(painting.primitives);
        fill(&self.gpu, &mut self.vertices, &mesh.vertices)?;
        fill(&self.gpu, &mut self.indices, &mesh.indices)?;
        fill(&self.gpu, &mut self.clips, &mesh.clips)?;
        for (id, range) in mesh.runs {
            // A texture that was freed while something still shows it is not worth an error.
            let Some(texture) = self.textures.get(id) else { continue };
            recorder
                .draw(&self.drawing)
                .read("vertices", &self.vertices)
                .read("indices", &self.indices)
                .read("clips", &self.clips)
                .sample("glyphs", texture)
                .push(&PanelParams { window: painting.points })
                .vertices_over(&mut [&mut *picture], range);
        }
        Ok(())
    }
}

/// Copies `data` to the start of `buffer`, which grows to the next power of two. Nothing in flight may read
/// it.
pub fn fill<T: bytemuck::Pod>(gpu: &Gpu, buffer: &mut Buffer<T>, data: &[T]) -> Result<()> {
    if buffer.len() < data.len() {
        let (name, len) = (buffer.name().to_owned(), data.len().next_power_of_two());
        *buffer = gpu.mapped(&name, "panels", len)?;
    }
    buffer.mapped_mut()?[..data.len()].copy_from_slice(data);
    Ok(())
}

impl Mesh {
    /// Collects the triangles of a frame; callbacks for painters of one graphics library are left out.
    pub fn of(primitives: &[ClippedPrimitive]) -> Self {
        let mut all = Mesh::default();
        for ClippedPrimitive { clip_rect, primitive } in primitives {
            let Primitive::Mesh(mesh) = primitive else { continue };
            all.add(*clip_rect, mesh);
        }
        all
    }

    fn add(&mut self, clip: Rect, mesh: &egui::epaint::Mesh) {
        let (first, row) = (self.vertices.len() as u32, self.clips.len() as u32);
        self.clips.push([clip.min.x, clip.min.y, clip.max.x, clip.max.y]);
        self.vertices.extend(mesh.vertices.iter().map(|v| PanelVertex {
            place: v.pos.into(),
            texel: v.uv.into(),
            colour: u32::from_le_bytes(v.color.to_array()),
            clip: row,
        }));
        let start = self.indices.len() as u32;
        self.indices.extend(mesh.indices.iter().map(|index| first + index));
        let end = self.indices.len() as u32;
        match self.runs.last_mut() {
            Some((id, range)) if *id == mesh.texture_id => range.end = end,
            _ => self.runs.push((mesh.texture_id, start..end)),
        }
    }
}

#[cfg(test)]
mod tests {
    use egui::epaint::{Color32, Mesh as Triangles, Vertex};
    use egui::pos2;

    use super::*;

    fn square(texture: TextureId) -> ClippedPrimitive {
        let corner = |x: f32, y: f32| Vertex { pos: pos2(x, y), uv: pos2(0.5, 0.5), color: Color32::RED };
        let mesh = Triangles {
            indices: vec![0, 1, 2, 2, 1, 3],
            vertices: vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0), corner(1.0, 1.0)],
            texture_id: texture,
        };
        ClippedPrimitive {
            clip_rect: Rect::from_min_max(pos2(1.0, 2.0), pos2(3.0, 4.0)),
            primitive: Primitive::Mesh(mesh),
        }
    }

    #[test]
    fn what_shares_a_texture_is_one_run() {
        let (a, b) = (TextureId::Managed(0), TextureId::Managed(1));
        let mesh = Mesh::of(&[square(a), square(a), square(b), square(a)]);
        assert_eq!(mesh.runs, [(a, 0..12), (b, 12..18), (a, 18..24)]);
        assert_eq!(mesh.indices[6..12], [4, 5, 6, 6, 5, 7]);
        assert_eq!(mesh.vertices[4].clip, 1);
        assert_eq!(mesh.clips[1], [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(mesh.vertices[0].colour, 0xff00_00ff);
    }
}
