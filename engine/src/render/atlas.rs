//! The atlas in which a decoded field lies on the device: its bricks, each with an apron, side by side in one
//! image (`include/medium.glsl`).

use glam::{IVec3, UVec3};
use rayon::prelude::*;
use shaders_glsl::medium as glsl;

use super::decoded::{Decoded, place_of};
use crate::error::{Error, Kind, Result};
use crate::volume::bricks::{BRICK, NO_SLOT};

/// Texels of a brick in the atlas along each axis: its own voxels and an apron of one voxel behind them.
const APRONED: usize = glsl::APRONED as usize;
/// Greatest number of bricks of an atlas along an axis, so that a place fits its bits.
const MOST_ALONG: u32 = (1 << glsl::PLACE_BITS) - 1;

/// A volume image of bricks, each with its apron.
pub(super) struct Atlas {
    pub(super) size: [u32; 3],
    /// Place of each brick of the grid among those of the atlas, ten bits an axis.
    pub(super) places: Vec<u32>,
    pub(super) texels: Vec<[u16; 2]>,
    pub(super) labels: Option<Vec<u8>>,
}

impl Decoded {
    /// Returns the voxels of a brick with its apron, as the atlas has them: from its first voxel on, x
    /// fastest.
    fn aproned(&self, brick: UVec3) -> impl Iterator<Item = IVec3> {
        let first = (brick * BRICK as u32).as_ivec3() - 1;
        (0..APRONED * APRONED * APRONED).map(move |i| {
            let at = [i % APRONED, i / APRONED % APRONED, i / (APRONED * APRONED)].map(|v| v as i32);
            first + IVec3::from_array(at)
        })
    }

    /// Returns the atlas for an image of at most `edge` texels along an axis. Its first brick is empty.
    pub(super) fn atlas(&self, edge: u32) -> Result<Atlas> {
        let count = self.bricks.element_product();
        let n = self.bricks;
        let brick_of = |i: u32| UVec3::new(i % n.x, i / n.x % n.y, i / (n.x * n.y));
        // The texels of a brick come from its own samples or from those of the bricks behind it.
        let sampled = |brick: UVec3| {
            (0..8).any(|corner| {
                let other = brick + UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
                other.cmplt(n).all() && self.slots[place_of(n, other)] != NO_SLOT
            })
        };
        let kept: Vec<u32> = (0..count)
            .into_par_iter()
            .filter(|&i| {
                let brick = brick_of(i);
                sampled(brick) && self.aproned(brick).any(|voxel| self.at(voxel) != self.empty)
            })
            .collect();
        let bricks = atlas_bricks(kept.len() as u32 + 1, (edge / APRONED as u32).min(MOST_ALONG))?;
        let place = |i: u32| {
            let [x, y] = [bricks[0], bricks[1]];
            [i % x, i / x % y, i / (x * y)]
        };
        let mut places = vec![0; count as usize];
        for (to, &i) in (1..).zip(&kept) {
            let [x, y, z] = place(to);
            places[i as usize] = x | y << glsl::PLACE_BITS | z << (2 * glsl::PLACE_BITS);
        }
        let size = bricks.map(|n| n * APRONED as u32);
        let [width, height, depth] = size.map(|n| n as usize);
        let mut texels = vec![self.empty; width * height * depth];
        let mut labels = self.labels.as_ref().map(|_| vec![self.label; texels.len()]);
        // A layer of bricks at a time.
        let layer = width * height * APRONED;
        let in_layer = (bricks[0] * bricks[1]) as usize;
        let fill = |z: usize, mut put: Box<dyn FnMut(usize, IVec3) + '_>| {
            for to in (z * in_layer).max(1)..((z + 1) * in_layer).min(kept.len() + 1) {
                let [x, y, _] = place(to as u32).map(|v| v as usize * APRONED);
                for (i, voxel) in self.aproned(brick_of(kept[to - 1])).enumerate() {
                    let [dx, dy, dz] = [i % APRONED, i / APRONED % APRONED, i / (APRONED * APRONED)];
                    put((dz * height + y + dy) * width + x + dx, voxel);
                }
            }
        };
        texels
            .par_chunks_mut(layer)
            .enumerate()
            .for_each(|(z, texels)| fill(z, Box::new(|at, voxel| texels[at] = self.at(voxel))));
        if let (Some(to), Some(from)) = (&mut labels, &self.labels) {
            to.par_chunks_mut(layer).enumerate().for_each(|(z, to)| {
                fill(z, Box::new(|at, voxel| to[at] = self.sample(voxel).map_or(self.label, |i| from[i])));
            });
        }
        Ok(Atlas { size, places, texels, labels })
    }
}

/// Returns the bricks along the axes of an atlas of `count` bricks, as nearly a cube as possible and at most
/// `most` along each axis.
fn atlas_bricks(count: u32, most: u32) -> Result<[u32; 3]> {
    let edge = f64::from(count).cbrt().ceil() as u32;
    let x = edge.clamp(1, most);
    let y = count.div_ceil(x).min(x);
    let z = count.div_ceil(x * y);
    if z <= most {
        return Ok([x, y, z]);
    }
    Err(Error::new(Kind::Unavailable, "VGS-RENDER-025", format!("{count} bricks are too many for an image"))
        .help("decode at a coarser pitch, or render in another --mode"))
}
