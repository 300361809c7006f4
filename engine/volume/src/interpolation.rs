//! Values between the voxels of a grid.

use glam::DVec3;

/// Returns the trilinear sample of a grid at `x` (voxel space), clamped to the edge, as every volume renderer
/// shows it. `at` returns the value of a voxel by its place in memory, x fastest.
pub fn trilinear(size: [usize; 3], x: DVec3, at: impl Fn(usize) -> f64) -> f64 {
    let last = DVec3::from_array(size.map(|n| n as f64 - 1.0));
    let p = x.clamp(DVec3::ZERO, last);
    let low = p.floor();
    let f = p - low;
    let low = low.to_array().map(|c| c as usize);
    let high: [usize; 3] = std::array::from_fn(|axis| (low[axis] + 1).min(size[axis] - 1));
    let row = |y: usize, z: usize| {
        let base = (z * size[1] + y) * size[0];
        lerp(at(base + low[0]), at(base + high[0]), f.x)
    };
    let slice = |z: usize| lerp(row(low[1], z), row(high[1], z), f.y);
    lerp(slice(low[2]), slice(high[2]), f.z)
}

/// Returns the linear interpolation between `a` and `b`. It gives both ends exactly, and a NaN end counts
/// only if it has weight.
fn lerp(a: f64, b: f64, t: f64) -> f64 {
    if t == 0.0 { a } else { a + (b - a) * t }
}
