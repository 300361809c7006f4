//! `raymarch`: a ray through a volume, by emission and absorption, front to back (Max, "Optical models for
//! direct volume rendering", 1995).
//!
//! A medium is an intensity V and an occupancy O on a voxel grid, interpolated separately. Where its voxels
//! belong to objects, O is the interpolated product of O and the object's opacity, and tints mix by their
//! parts of O. The extinction is opacity O (1 − exp(−τ(V))) per mm; a ray is cut into cells, and those that can
//! show something into parts. There are no bricks and packets: every cell of every ray is visited, except in blocks
//! of voxels that hold nothing. An eye that is far away sees as an orthographic one does.

use glam::{DAffine3, DVec3, DVec4};
use rayon::prelude::*;
use shader_interface::march::{CLOSED, HIDING, LARGE_BALL, OPEN, SMALL_BALL};

use super::eye::{Appearance, Eye, Gathered, Lamp, lit, opacity, tinted};
use super::occupancy::occupancy_mark;
use super::slab::{Look, NEAREST};
use volume::trilinear;

/// A part that adds less than this is not lit anew, but takes the light of the part before. Where gradients are kept all
/// others are; else one that adds more than [`STRONG`] always is, and parts between are if their index is even, or that of
/// the cell where it has one part.
const FAINT: f64 = 1.0 / 4096.0;
const STRONG: f64 = 1.0 / 64.0;
/// Edge of a block, voxels.
const BLOCK: usize = 4;

/// Intensity and occupancy on a grid, x fastest.
#[derive(Clone, Debug)]
pub struct Medium {
    size: [usize; 3],
    voxel_from_scene: DAffine3,
    values: Vec<f32>,
    mask: Option<Vec<f32>>,
    /// Appearance of each voxel.
    objects: Option<Vec<Appearance>>,
    /// Transfer function of each voxel: 0 is that of the look, k + 1 its k-th own function of an object.
    functions: Option<Vec<usize>>,
    /// Twice the gradient of O (V − v₀) at each voxel, in voxel space, if they are kept.
    gradients: Option<Vec<DVec3>>,
    /// True if a point whose low corner is in this block of 4³ voxels may see an occupancy; blocks start at
    /// voxel -1.
    blocks: Vec<bool>,
}

impl Medium {
    /// Creates a medium. Without a mask all of the grid is occupied.
    ///
    /// # Panics
    /// If there is not one value and one occupancy for every voxel.
    pub fn new(size: [usize; 3], scene_from_voxel: DAffine3, values: &[f32], mask: Option<&[f32]>) -> Self {
        let count: usize = size.iter().product();
        let fits = values.len() == count && mask.is_none_or(|m| m.len() == count);
        assert!(fits, "one value and one occupancy for every voxel");
        let mut medium = Medium {
            size,
            voxel_from_scene: scene_from_voxel.inverse(),
            values: values.to_vec(),
            mask: mask.map(<[f32]>::to_vec),
            objects: None,
            functions: None,
            gradients: None,
            blocks: Vec::new(),
        };
        medium.blocks = medium.occupied_blocks();
        medium
    }

    /// Adds an appearance for each voxel.
    ///
    /// # Panics
    /// If there is not one for each voxel, or the medium has no mask.
    pub fn with_objects(mut self, objects: Vec<Appearance>) -> Self {
        assert!(self.mask.is_some() && objects.len() == self.values.len(), "one appearance for every voxel");
        self.objects = Some(objects);
        self
    }

    /// Adds a transfer function for each voxel, after the appearances: 0 is that of the look, k + 1 number k of
    /// [`Look::functions`].
    ///
    /// # Panics
    /// If there is not one for each voxel.
    pub fn with_functions(mut self, functions: Vec<usize>) -> Self {
        assert!(self.objects.is_some() && functions.len() == self.values.len(), "one for every voxel");
        self.functions = Some(functions);
        self
    }

    /// Adds what is taken for twice the gradients of O (V − v₀) at the voxels: [`Medium::voxel_gradients`], rounded.
    ///
    /// # Panics
    /// If there is not one for each voxel.
    pub fn with_gradients(mut self, gradients: Vec<DVec3>) -> Self {
        assert_eq!(gradients.len(), self.values.len(), "one gradient for every voxel");
        self.gradients = Some(gradients);
        self
    }

    /// Adds the gradients at the voxels, as they are.
    pub fn with_own_gradients(self, dark: f64) -> Self {
        let gradients = self.voxel_gradients(dark);
        self.with_gradients(gradients)
    }

    /// Returns for each voxel the difference of O (V − dark), by what opacities leave of O, between its neighbours along
    /// x, y and z. Beyond the grid O is 0.
    pub fn voxel_gradients(&self, dark: f64) -> Vec<DVec3> {
        let [nx, ny, _] = self.size;
        let excess = |voxel: [i64; 3]| {
            if (0..3).any(|k| voxel[k] < 0 || voxel[k] >= self.size[k] as i64) {
                return 0.0;
            }
            let [x, y, z] = voxel.map(|v| v as usize);
            let i = (z * ny + y) * nx + x;
            self.shown_at(i) * (f64::from(self.values[i]) - dark)
        };
        let along = |i: usize, axis: usize| {
            let voxel = [i % nx, i / nx % ny, i / (nx * ny)].map(|v| v as i64);
            let beside = |by: i64| std::array::from_fn(|k| voxel[k] + if k == axis { by } else { 0 });
            excess(beside(1)) - excess(beside(-1))
        };
        (0..self.values.len()).map(|i| DVec3::from_array([0, 1, 2].map(|axis| along(i, axis)))).collect()
    }

    /// Returns what opacities leave of O at a voxel.
    fn shown_at(&self, index: usize) -> f64 {
        let o = self.mask.as_ref().map_or(1.0, |mask| f64::from(mask[index]));
        o * self.objects.as_ref().map_or(1.0, |objects| objects[index].opacity)
    }

    fn block_counts(&self) -> [usize; 3] {
        self.size.map(|n| n / BLOCK + 1)
    }

    fn occupied_blocks(&self) -> Vec<bool> {
        let [bx, by, bz] = self.block_counts();
        let [nx, ny, _] = self.size;
        let Some(mask) = &self.mask else { return vec![true; bx * by * bz] };
        let mut blocks = vec![false; bx * by * bz];
        for (i, _) in mask.iter().enumerate().filter(|(_, m)| **m > 0.0) {
            // Voxel v is seen from low corners v - 1 and v, which are v and v + 1 when counted from -1.
            let voxel = [i % nx, i / nx % ny, i / (nx * ny)];
            let [xs, ys, zs] = voxel.map(|v| [v / BLOCK, (v + 1) / BLOCK]);
            for z in zs {
                for y in ys {
                    for x in xs {
                        blocks[(z * by + y) * bx + x] = true;
                    }
                }
            }
        }
        blocks
    }

    /// Returns true if there may be an occupancy at a point of the grid with its border.
    fn may_hold(&self, voxel: DVec3) -> bool {
        let counts = self.block_counts();
        let at = |axis: usize| ((voxel[axis] + 1.0).max(0.0) as usize / BLOCK).min(counts[axis] - 1);
        self.blocks[(at(2) * counts[1] + at(1)) * counts[0] + at(0)]
    }

    /// Interpolates V and O at a point of voxel space. Beyond the outermost voxel centres V is that of the
    /// edge, and O fades to 0 over one voxel.
    pub fn sample(&self, voxel: DVec3) -> (f64, f64) {
        let (v, o, _) = self.seen(voxel);
        (v, o)
    }

    /// Interpolates V, O and the tint at a point of voxel space.
    fn seen(&self, voxel: DVec3) -> (f64, f64, DVec4) {
        let value = trilinear(self.size, voxel, |i| f64::from(self.values[i]));
        let size = DVec3::from_array(self.size.map(|n| n as f64));
        let Some(mask) = &self.mask else {
            let inside = (voxel + 1.0).min(size - voxel).clamp(DVec3::ZERO, DVec3::ONE);
            return (value, inside.element_product(), DVec4::ZERO);
        };
        let (mut whole, mut shown, mut tint) = (0.0, 0.0, DVec4::ZERO);
        for (index, share) in self.around(voxel) {
            let o = share * f64::from(mask[index]);
            let object = self.objects.as_ref().map_or_else(Appearance::default, |all| all[index]);
            whole += o;
            shown += o * object.opacity;
            tint += object.tint * o;
        }
        (value, shown, if whole > 0.0 { tint / whole } else { DVec4::ZERO })
    }

    /// Returns the voxels around a point of voxel space that are in the grid, with their trilinear weights.
    fn around(&self, voxel: DVec3) -> impl Iterator<Item = (usize, f64)> {
        let low = voxel.floor();
        let part = voxel - low;
        let low = low.as_i64vec3();
        let size = self.size;
        (0..8).filter_map(move |corner| {
            let mut share = 1.0;
            let mut index = 0;
            for axis in (0..3).rev() {
                let far = corner >> axis & 1;
                let at = low[axis] + far;
                if at < 0 || at >= size[axis] as i64 {
                    return None;
                }
                share *= if far == 1 { part[axis] } else { 1.0 - part[axis] };
                index = index * size[axis] + at as usize;
            }
            (share > 0.0).then_some((index, share))
        })
    }

    /// Returns colour, tinted, and opacity per mm that the functions of the voxels around a point of voxel space
    /// make of the way from one intensity to another, each by its part of O, and of the gradient's magnitude.
    fn shown(
        &self,
        voxel: DVec3,
        [from, to]: [f64; 2],
        functions: &[usize],
        magnitude: f64,
        look: &Look<'_>,
    ) -> (DVec3, f64) {
        let (Some(mask), Some(objects)) = (&self.mask, &self.objects) else { return (DVec3::ZERO, 0.0) };
        let (mut colour, mut opacity) = (DVec3::ZERO, 0.0);
        for (index, share) in self.around(voxel) {
            let table = match functions[index] {
                0 => look.table,
                k => &look.functions[k - 1],
            };
            let (own, extinction) = if look.segments { table.segment(from, to) } else { table.point(to) };
            let occupancy =
                f64::from(mask[index]) * objects[index].opacity * table.gradient_factor(magnitude);
            let part = share * occupancy * -(-extinction).exp_m1();
            colour += part * tinted(own, objects[index].tint);
            opacity += part;
        }
        if opacity > 0.0 { (colour / opacity, opacity) } else { (DVec3::ZERO, 0.0) }
    }

    /// Returns the gradient of O (V - dark) in voxel space, by central differences over a voxel on each side: those at the
    /// voxels, interpolated, if they are kept, or else those of what is interpolated.
    fn gradient(&self, voxel: DVec3, dark: f64) -> DVec3 {
        if let Some(kept) = &self.gradients {
            let along = |axis: usize| 0.5 * trilinear(self.size, voxel, |i| kept[i][axis]);
            return DVec3::from_array([0, 1, 2].map(along));
        }
        let excess = |p: DVec3| {
            let (v, o) = self.sample(p);
            o * (v - dark)
        };
        let along = |axis: DVec3| 0.5 * (excess(voxel + axis) - excess(voxel - axis));
        DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
    }

    /// Returns the opacity over `path` mm at a point of voxel space: 0 where clip planes cut. Of objects that of the
    /// nearest voxel counts.
    fn blocked(&self, voxel: DVec3, path: f64, look: &Look<'_>) -> f64 {
        let place = self.voxel_from_scene.inverse().transform_point3(voxel);
        if look.planes.iter().any(|&[x, y, z, d]| place.dot(DVec3::new(x, y, z)) + d < 0.0) {
            return 0.0;
        }
        let value = trilinear(self.size, voxel, |i| f64::from(self.values[i]));
        let last = DVec3::from_array(self.size.map(|n| n as f64 - 1.0));
        let [x, y, z] = (voxel + 0.5).floor().clamp(DVec3::ZERO, last).to_array().map(|v| v as usize);
        let nearest = (z * self.size[1] + y) * self.size[0] + x;
        let (occupancy, table) = match (&self.mask, &self.objects) {
            (Some(mask), Some(objects)) => {
                let whole: f64 = self.around(voxel).map(|(i, share)| share * f64::from(mask[i])).sum();
                let function = self.functions.as_ref().map_or(0, |functions| functions[nearest]);
                let table = if function == 0 { look.table } else { &look.functions[function - 1] };
                (whole * objects[nearest].opacity, table)
            }
            _ => (self.sample(voxel).1, look.table),
        };
        opacity(table.point(value).1, occupancy, path)
    }

    /// Returns how much around a point of a surface is opaque, 0 to 1; point and gradient are those of voxel space.
    /// It follows from the mean opacity over the radius, at the corners of a tetrahedron in each, of two balls that
    /// touch the surface from outside (Szirmay-Kalos et al., "Volumetric ambient occlusion for real-time rendering and
    /// games", 2010).
    pub fn occlusion(&self, voxel: DVec3, gradient: DVec3, look: &Look<'_>) -> f64 {
        let rows = self.voxel_from_scene.matrix3.transpose();
        let per_mm = DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length());
        let edge = 1.0 / per_mm.max_element();
        let [small, large] = [SMALL_BALL, LARGE_BALL].map(f64::from);
        let mut sum = 0.0;
        for (radius, side) in [(small, 1.0), (large, -1.0)] {
            // In voxels along each axis.
            let radii = (radius * edge * per_mm).max(DVec3::splat(small));
            // Towards the surface, for a ball of radius 1.
            let Some(inward) = (radii * gradient).try_normalize() else { return 0.0 };
            for signs in [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]] {
                let corner = side * 0.2f64.sqrt() * DVec3::from_array(signs);
                sum += self.blocked(voxel + radii * (corner - inward), radius * edge, look);
            }
        }
        let [open, closed] = [OPEN, CLOSED].map(f64::from);
        ((sum / 8.0 - open) / (closed - open)).clamp(0.0, 1.0)
    }

    /// Returns the parameters between which a ray in voxel space is inside the grid with its border of one
    /// voxel.
    fn crossing(&self, origin: DVec3, direction: DVec3) -> [f64; 2] {
        let mut range = [f64::NEG_INFINITY, f64::INFINITY];
        for axis in 0..3 {
            let (low, high) = (-1.0, self.size[axis] as f64);
            if direction[axis] == 0.0 {
                if !(low..=high).contains(&origin[axis]) {
                    return [1.0, -1.0];
                }
                continue;
            }
            let a = (low - origin[axis]) / direction[axis];
            let b = (high - origin[axis]) / direction[axis];
            range = [range[0].max(a.min(b)), range[1].min(a.max(b))];
        }
        range
    }
}

/// Returns a number from 0 to 1 for each pixel of each view, by which the cells of its ray are shifted (PCG
/// of Jarzynski and Olano 2020).
pub fn noise([x, y]: [u32; 2], view: u32) -> f64 {
    let h = view.wrapping_mul(8192).wrapping_add(y).wrapping_mul(65536).wrapping_add(x);
    let h = h.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let h = ((h >> ((h >> 28) + 4)) ^ h).wrapping_mul(277_803_737);
    let h = (h >> 22) ^ h;
    f64::from(h >> 8) / 16_777_216.0
}

/// Returns the mean of where a ray is absorbed in a homogeneous cell of this opacity, as a part of the cell.
fn seen_part(opacity: f64) -> f64 {
    if opacity < 0.01 { 0.5 } else { -1.0 / (-opacity).ln_1p() - (1.0 - opacity) / opacity }
}

/// How rays are cut into cells.
#[derive(Clone, Copy, Debug)]
pub struct Cells {
    /// Length of a cell, mm.
    pub length: f64,
    /// Number of parts into which a cell is cut where something can show, each of which is sampled.
    pub parts: u32,
    /// How far beyond the intensities at its ends something in a cell can be.
    pub slack: f64,
}

impl Cells {
    /// Creates cells of one part of this length, mm.
    pub fn even(length: f64) -> Self {
        Cells { length, parts: 1, slack: 0.0 }
    }

    /// Returns true if a cell with these V and O at its ends can show something; `past` is V at the start of the cell
    /// before.
    fn could_show(&self, past: f64, ends: [(f64, f64); 2], look: &Look<'_>) -> bool {
        let [(v, o), (w, p)] = ends;
        let (rise, half_change) = (v - past, 0.5 * (w - v).abs());
        let low = v.min(w) - self.slack.max(-rise - half_change);
        let high = v.max(w) + self.slack.max(rise - half_change);
        // A function of an object counts within two entries of those that it shows.
        let margins = look.functions.iter().map(|table| (table, 2.0 * look.table.step));
        let mut tables = std::iter::once((look.table, 0.0)).chain(margins);
        o.max(p) > 0.0
            && tables.any(|(table, margin)| {
                occupancy_mark(&[[(low - margin) as f32, (high + margin) as f32]], table, 1) == [0]
            })
    }
}

/// A ray on its way.
struct Ray<'a> {
    medium: &'a Medium,
    eye: &'a Eye,
    look: &'a Look<'a>,
    lamp: Lamp,
    /// In eye space, depth 1.
    toward: DVec3,
    /// In voxel space.
    origin: DVec3,
    direction: DVec3,
    /// As last found, in eye space, with the share of the light that occlusion leaves.
    gradient: DVec3,
    light: f64,
    gathered: Gathered,
}

impl Ray<'_> {
    fn sample(&self, z: f64) -> (f64, f64) {
        self.medium.sample(self.origin + self.direction * z)
    }

    /// Adds what is between two depths. `before` are V and O at the first one, if the function is integrated from
    /// there; `even` tells whether the index of the part is even.
    fn add(&mut self, [from, to]: [f64; 2], before: &mut Option<(f64, f64)>, even: bool) {
        let (medium, eye, look) = (self.medium, self.eye, self.look);
        let z = if look.segments { to } else { 0.5 * (from + to) };
        let at = self.origin + self.direction * z;
        if !look.segments && !medium.may_hold(at) {
            return;
        }
        let (v, o, tint) = medium.seen(at);
        let path = (to - from) * self.toward.length();
        let (vb, ob) = if look.segments { before.replace((v, o)).unwrap_or((v, o)) } else { (v, o) };
        let in_scene = |slopes: DVec3| medium.voxel_from_scene.matrix3.transpose() * slopes;
        let magnitude =
            look.gradient_edge.map_or(0.0, |edge| edge * in_scene(medium.gradient(at, look.dark)).length());
        let (mut base, opacity) = match &medium.functions {
            Some(functions) => {
                let (colour, per_mm) = medium.shown(at, [vb, v], functions, magnitude, look);
                (colour, -(path * (-per_mm).ln_1p()).exp_m1())
            }
            None => {
                let (colour, extinction) =
                    if look.segments { look.table.segment(vb, v) } else { look.table.point(v) };
                let occupancy = look.table.gradient_factor(magnitude) * 0.5 * (ob + o);
                (tinted(colour, tint), opacity(extinction, occupancy, path))
            }
        };
        let share = self.gathered.clear * opacity;
        if look.material.shade {
            if share > STRONG || share > FAINT && (even || medium.gradients.is_some()) {
                let slopes = medium.gradient(at, look.dark);
                self.gradient = eye.turn * in_scene(slopes);
                if look.material.occlusion > 0.0 {
                    // A long part is seen at its front, and what hides all behind it from the viewer's side, also
                    // where the sample is behind the crest of a thin shell.
                    let seen = self.origin + self.direction * (from + seen_part(opacity) * (to - from));
                    let behind_crest = opacity > f64::from(HIDING) && self.gradient.dot(self.toward) < 0.0;
                    let inward = if behind_crest { -slopes } else { slopes };
                    self.light = 1.0 - look.material.occlusion * medium.occlusion(seen, inward, look);
                }
            }
            base = lit(base, self.gradient, self.toward, look.material, &self.lamp, self.light);
        }
        self.gathered.add(base, opacity, z);
    }
}

/// Gathers a ray (of eye space, depth 1) in cells, the first of which begins `shift` of a cell from the eye.
pub fn ray(medium: &Medium, eye: &Eye, ray: DVec3, look: &Look<'_>, cells: &Cells, shift: f64) -> Gathered {
    let mut way = Ray {
        medium,
        eye,
        look,
        lamp: eye.lamp(look.light),
        toward: ray,
        origin: medium.voxel_from_scene.transform_point3(eye.position),
        direction: medium.voxel_from_scene.transform_vector3(eye.direction(ray)),
        gradient: DVec3::ZERO,
        light: 1.0,
        gathered: Gathered::default(),
    };
    let clipped = eye.clipped(ray, look.planes);
    let crossing = medium.crossing(way.origin, way.direction);
    let range = [clipped[0].max(crossing[0]).max(NEAREST), clipped[1].min(crossing[1])];
    if range[0] >= range[1] {
        return way.gathered;
    }
    let dz = cells.length / ray.length();
    let knows_ends = cells.parts > 1 || look.segments;
    // V and O at the ends of the cell before.
    let mut ends_before: Option<[(f64, f64); 2]> = None;
    let mut k = (range[0] / dz - shift).floor();
    while (k + shift) * dz < range[1] && way.gathered.clear > look.least_light {
        let from = ((k + shift) * dz).max(range[0]);
        let to = ((k + 1.0 + shift) * dz).min(range[1]);
        let ends = knows_ends.then(|| {
            let start = ends_before.map_or_else(|| way.sample(from), |[_, end]| end);
            [start, way.sample(to)]
        });
        if ends.is_none_or(|ends| {
            let [(past, _), _] = ends_before.unwrap_or(ends);
            cells.could_show(past, ends, look)
        }) {
            let mut before = ends.map(|[start, _]| start);
            let part = (to - from) / f64::from(cells.parts);
            for i in 0..cells.parts {
                if way.gathered.clear <= look.least_light {
                    break;
                }
                let even = if cells.parts > 1 { i % 2 == 0 } else { k.rem_euclid(2.0) == 0.0 };
                let [i, next] = [i, i + 1].map(f64::from);
                way.add([from + i * part, from + next * part], &mut before, even);
            }
        }
        ends_before = ends;
        k += 1.0;
    }
    way.gathered
}

/// Renders a picture of `size` pixels: premultiplied colour and opacity of each, rows from the top.
pub fn render(medium: &Medium, eye: &Eye, size: [u32; 2], look: &Look<'_>, cells: &Cells) -> Vec<[f32; 4]> {
    (0..size[0] * size[1])
        .into_par_iter()
        .map(|i| {
            let place = [f64::from(i % size[0]) + 0.5, f64::from(i / size[0]) + 0.5];
            ray(medium, eye, eye.ray(place, size), look, cells, 0.0).pixel().map(|v| v as f32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use transfer::{ColourPoint, Light, Material, OpacityPoint, Table, TransferFunction};

    const LIGHT: Light = Light { towards: [-0.4, 0.5, 1.0], ..Light::HEAD };

    /// Creates a function with the same extinction everywhere.
    fn flat(extinction: f64, material: Material) -> TransferFunction {
        let colour = DVec3::new(1.0, 0.5, 0.0);
        TransferFunction::new(
            "flat",
            vec![ColourPoint { intensity: 0.0, colour }],
            vec![OpacityPoint { intensity: 0.0, opacity: 1.0 - (-extinction).exp() }],
            material,
        )
        .expect("a transfer function")
    }

    fn look<'a>(table: &'a Table, material: &'a Material) -> Look<'a> {
        let (planes, gradient_edge) = (&[], None);
        Look {
            table,
            functions: &[],
            material,
            light: &LIGHT,
            dark: 0.0,
            planes,
            gradient_edge,
            segments: false,
            least_light: 1e-4,
        }
    }

    /// Creates an eye at +y, so far away that rays are nearly parallel.
    fn eye() -> Eye {
        let (distance, half) = (1e5, 2.5);
        let turn = DMat3::from_cols(DVec3::NEG_X, DVec3::Z, DVec3::NEG_Y).transpose();
        let tangent = half / distance;
        Eye {
            position: DVec3::new(7.5, 7.5 + distance, 7.5),
            turn,
            tangents: [-tangent, tangent, tangent, -tangent],
        }
    }

    /// Creates a slab of 8 voxels along y in a grid of 16³.
    fn slab() -> Medium {
        let mask: Vec<f32> =
            (0..4096).map(|i| f32::from(u8::from((4..12).contains(&(i / 16 % 16))))).collect();
        Medium::new([16; 3], DAffine3::IDENTITY, &vec![100.0; 4096], Some(&mask))
    }

    #[test]
    fn a_slab_absorbs_by_its_thickness() {
        // Trilinear edges: the occupancy is 1 over 7 voxels and falls to 0 over one on each side; without a
        // mask it is 1 over 15 likewise.
        let whole = Medium::new([16; 3], DAffine3::IDENTITY, &vec![100.0; 4096], None);
        for (medium, thickness) in [(slab(), 7.0), (whole, 15.0)] {
            for extinction in [0.01, 0.1, 0.5] {
                let tf = flat(extinction, Material::default());
                let table = Table::new(&tf, [0.0, 200.0]);
                let image = render(&medium, &eye(), [5, 5], &look(&table, &tf.material), &Cells::even(0.05));
                // ∫ ln(1 − α t) dt from 0 to 1, with α the opacity per mm.
                let alpha: f64 = 1.0 - (-extinction).exp();
                let edge = (extinction * (1.0 - alpha) - alpha) / alpha;
                let expected = 1.0 - (-thickness * extinction + 2.0 * edge).exp();
                for pixel in image {
                    assert!((f64::from(pixel[3]) - expected).abs() < 2e-4, "{pixel:?} against {expected}");
                    assert!(
                        (pixel[1] - 0.5 * pixel[0]).abs() < 1e-5 && pixel[2] == 0.0,
                        "the function's colour"
                    );
                }
            }
        }
    }

    #[test]
    fn surfaces_are_lit() {
        let material = Material {
            shade: true,
            ambient: 0.25,
            diffuse: 0.75,
            specular: 0.1,
            power: 30.0,
            ..Material::default()
        };
        let tf = flat(7.0, material);
        let table = Table::new(&tf, [0.0, 200.0]);
        let image = render(&slab(), &eye(), [5, 5], &look(&table, &material), &Cells::even(0.1));
        let lamp = eye().lamp(&Light::default());
        let facing = lit(DVec3::new(1.0, 0.5, 0.0), DVec3::NEG_Z, DVec3::Z, &material, &lamp, 1.0);
        assert!((f64::from(image[12][0]) - facing.x).abs() < 0.02, "{:?} {facing}", image[12]);
        assert!(facing.x < 0.95, "light comes from the side: {facing}");
    }

    #[test]
    fn nothing_is_skipped_that_holds_something() {
        let size = [9, 8, 11];
        let marked = [[0, 0, 0], [3, 3, 3], [8, 7, 10], [4, 7, 5]];
        for mark in marked {
            let index = (mark[2] * size[1] + mark[1]) * size[0] + mark[0];
            let mut mask = vec![0.0; 9 * 8 * 11];
            mask[index] = 1.0;
            let medium = Medium::new(size, DAffine3::IDENTITY, &vec![1.0; 9 * 8 * 11], Some(&mask));
            let mut skipped = 0;
            for i in 0..40 * 40 * 40 {
                let p = DVec3::new((i % 40) as f64, (i / 40 % 40) as f64, (i / 1600) as f64) * 0.31 - 1.0;
                if !medium.may_hold(p) {
                    skipped += 1;
                    assert_eq!(medium.sample(p).1, 0.0, "{p}");
                }
            }
            assert!(skipped > 32_000, "most of the grid is skipped: {skipped}");
        }
    }

    /// Creates bone where `is_bone` returns true for a voxel, in air, with voxels of 1 × 1 × 2 mm.
    fn carved(is_bone: impl Fn([i64; 3]) -> bool) -> Medium {
        let size = [40, 40, 40];
        let place = |i: usize| [i % 40, i / 40 % 40, i / 1600].map(|v| v as i64);
        let values: Vec<f32> =
            (0..64_000).map(|i| if is_bone(place(i)) { 1000.0 } else { -1000.0 }).collect();
        Medium::new(size, DAffine3::from_scale(DVec3::new(1.0, 1.0, 2.0)), &values, None)
    }

    /// Returns the occlusion at a point of voxel space, with clip planes.
    fn occlusion(medium: &Medium, at: [f64; 3], planes: &[[f64; 4]]) -> f64 {
        let tf = transfer::preset("CT-Bones-Steep").expect("a preset").over([-1000.0, 1000.0]);
        let table = Table::new(&tf, [-1000.0, 1000.0]);
        let look = Look { planes, ..look(&table, &tf.material) };
        let at = DVec3::from_array(at);
        medium.occlusion(at, medium.gradient(at, look.dark), &look)
    }

    #[test]
    fn crevices_are_occluded_and_plain_and_bulging_surfaces_are_not() {
        let plain = carved(|[_, _, z]| z < 20);
        let plain_along_x = carved(|[x, _, _]| x < 20);
        let ball = carved(|p| p.map(|v| (v - 20).pow(2)).iter().sum::<i64>() < 100);
        for (name, medium, at) in [
            ("plain", &plain, [20.0, 20.0, 19.6]),
            ("plain, across thin slices", &plain_along_x, [19.6, 20.0, 20.0]),
            ("ball", &ball, [20.0, 20.0, 29.4]),
            ("ball, aside", &ball, [26.8, 26.8, 20.0]),
        ] {
            let found = occlusion(medium, at, &[]);
            assert!(found < 0.03, "{name}: {found}");
        }
        // Three voxels wide and twelve deep.
        let pit = carved(|[x, y, z]| z < 20 && !(z >= 8 && (x - 20).abs() < 2 && (y - 20).abs() < 2));
        let bottom = [20.0, 20.0, 7.6];
        let deep = occlusion(&pit, bottom, &[]);
        assert!(deep > 0.6, "{deep}");
        // A plane that cuts everything around away leaves nothing to occlude.
        let cut = occlusion(&pit, bottom, &[[0.0, 0.0, -1.0, 2.0 * 7.7]]);
        assert!(cut < 0.03, "{cut}");
    }

    #[test]
    fn noise_is_even() {
        let mean = (0..10_000).map(|i| noise([i % 100, i / 100], 1)).sum::<f64>() / 1e4;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
        assert!(noise([3, 4], 0) != noise([4, 3], 0) && noise([3, 4], 0) != noise([3, 4], 1));
    }
}
