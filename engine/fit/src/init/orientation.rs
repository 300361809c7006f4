//! Orientation of the first splats: the cues of the smoothed volume that turn them, and the table of these
//! cues.
//!
//! A turn is a frame whose z axis is the thin one (across an edge or a vessel) and whose x axis is the long
//! one (along a vessel). With G∗V the smoothed volume:
//! - gradient: z along ∇(G∗V); x is any direction in the edge.
//! - structure tensor: eigenvectors of G∗(∇∇ᵀ), the largest value z, the smallest x. In a vessel's middle,
//!   where the gradient vanishes, the gradients around it still tell its direction.
//! - Hessian: eigenvectors of ∇∇ᵀ(G∗V) by |λ|, the largest z, the smallest x. Along a tube the volume does
//!   not bend. On the very edge of a wide structure it does not bend either, so there the direction is weak.
//!
//! Derivatives are taken per voxel. Splats shaped in millimetres need them per millimetre: for the
//! index-to-world matrix L a gradient becomes L⁻ᵀg and a tensor L⁻ᵀTL⁻¹. The smoothing is by voxels in both
//! cases, as the paper has it.

use std::fmt;

use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;

use super::density::Density;
use super::symmetric::eigen;

/// Unit quaternion (w, x, y, z) of a frame with the thin axis z and the long axis x; nothing where there is
/// no direction.
pub(super) type Turn = Option<[f32; 4]>;

/// Function that finds the turns at points of voxel space. The matrix is L⁻ᵀ where splats are shaped in
/// millimetres.
type Run = fn(&Density, &[[f32; 3]], Option<&DMat3>) -> Vec<Turn>;

/// A way to turn splats at first.
pub struct Orientation {
    /// Name in configurations.
    pub name: &'static str,
    /// True if the cue tells the long axis best, so that "gradient" lengthens splats along it instead of
    /// flattening them across the thin one.
    pub lengthens: bool,
    pub(super) run: Run,
}

/// Every way to turn splats at first; the first is the default.
pub const ORIENTATIONS: &[Orientation] = &[
    Orientation { name: "gradient", lengthens: false, run: by_gradient },
    Orientation { name: "structure-tensor", lengthens: false, run: by_structure_tensor },
    Orientation { name: "hessian", lengthens: true, run: by_hessian },
    Orientation { name: "none", lengthens: false, run: |_, points, _| vec![None; points.len()] },
];

impl PartialEq for Orientation {
    /// Compares the names, which are unique in the table.
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl fmt::Debug for Orientation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Orientation({})", self.name)
    }
}

/// There is no direction where the gradient (per voxel) or the Hessian (per voxel²) is below this share of
/// the region's mean gradient (per voxel).
const FLAT: f64 = 1e-3;

fn by_gradient(density: &Density, points: &[[f32; 3]], per_mm: Option<&DMat3>) -> Vec<Turn> {
    points
        .par_iter()
        .map(|&point| {
            let gradient = density.gradient(point);
            let steep = gradient.length() > FLAT * density.mean_gradient;
            steep.then(|| z_onto(per_mm.map_or(gradient, |m| *m * gradient)))
        })
        .collect()
}

fn by_structure_tensor(density: &Density, points: &[[f32; 3]], per_mm: Option<&DMat3>) -> Vec<Turn> {
    let flat = FLAT * density.mean_gradient;
    let trace = |t: &DMat3| t.x_axis.x + t.y_axis.y + t.z_axis.z;
    let tensors = density.structure_tensors(points);
    tensors.par_iter().map(|t| (trace(t) > flat * flat).then(|| frame(t, per_mm))).collect()
}

fn by_hessian(density: &Density, points: &[[f32; 3]], per_mm: Option<&DMat3>) -> Vec<Turn> {
    let flat = FLAT * density.mean_gradient;
    points
        .par_iter()
        .map(|&point| {
            let hessian = density.hessian(point);
            let norm = hessian.to_cols_array().iter().map(|v| v * v).sum::<f64>().sqrt();
            (norm > flat).then(|| frame(&hessian, per_mm))
        })
        .collect()
}

/// Returns the turn of a tensor: the x axis where its eigenvalue is smallest in magnitude, the z axis where
/// it is largest.
fn frame(tensor: &DMat3, per_mm: Option<&DMat3>) -> [f32; 4] {
    let (_, axes) = eigen(&per_mm.map_or(*tensor, |m| *m * *tensor * m.transpose()));
    quaternion(DQuat::from_mat3(&axes).normalize())
}

/// Returns a turn that takes the z axis onto the line of `direction`, which must not vanish.
fn z_onto(direction: DVec3) -> [f32; 4] {
    // Either sense of the line will do; the upper one is never opposite to z.
    let direction = direction.normalize();
    let direction = if direction.z < 0.0 { -direction } else { direction };
    quaternion(DQuat::from_rotation_arc(DVec3::Z, direction))
}

fn quaternion(q: DQuat) -> [f32; 4] {
    [q.w as f32, q.x as f32, q.y as f32, q.z as f32]
}
