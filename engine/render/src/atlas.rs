//! The atlas in which a decoded field lies on the device: its bricks, each with an apron, side by side in one
//! image (`include/medium.glsl`).

use glam::{DVec3, IVec3, UVec3};
use rayon::prelude::*;
use shaders_glsl::medium as glsl;

use super::decoded::{Decoded, place_of};
use super::detail::{EVEN, Node, chosen};
use base::error::{Error, Kind, Result};
use passes::voxel_gradients::NOWHERE;
use volume::bricks::NO_SLOT;

/// Texels of a brick in the atlas along each axis: its own voxels and an apron of one voxel behind them.
const APRONED: usize = glsl::APRONED as usize;
/// What stands beside a label that all in its cell has.
pub(super) const ALONE: u8 = u8::MAX;
/// Greatest number of bricks of an atlas along an axis, so that a place fits its bits.
const MOST_ALONG: u32 = (1 << glsl::PLACE_BITS) - 1;

/// Bytes of a texel on the device, with its gradient; and of its label.
const TEXEL_BYTES: u64 = 4 + 8;
const LABEL_BYTES: u64 = 2;

/// Tells how large a brick is seen, by its middle and radius, voxels of the box.
pub(super) type SeenSize<'a> = dyn Fn(DVec3, f64) -> f64 + 'a;

/// A volume image of bricks, each with its apron.
pub(super) struct Atlas {
    pub(super) size: [u32; 3],
    /// Place of each brick of the grid among those of the atlas, ten bits an axis.
    pub(super) places: Vec<u32>,
    /// Coordinates of the brick of the grid at each place, x fastest, and its level.
    pub(super) bricks: Vec<[u32; 4]>,
    /// Level of each brick of the grid; `None` if all are of the first.
    pub(super) levels: Option<Vec<u8>>,
    pub(super) texels: Vec<[u16; 2]>,
    /// The label of each texel, and 255 if all that is in its cell has that label.
    pub(super) labels: Option<Vec<[u8; 2]>>,
}

impl Decoded {
    /// Returns the voxels of a brick with its apron, as the atlas has them: from its first voxel on, x
    /// fastest.
    fn aproned(node: Node) -> impl Iterator<Item = IVec3> {
        (0..APRONED * APRONED * APRONED).map(move |i| {
            let at = [i % APRONED, i / APRONED % APRONED, i / (APRONED * APRONED)].map(|v| v as i32);
            node.first_voxel() + node.stride() * IVec3::from_array(at)
        })
    }

    /// Returns the atlas for an image of at most `edge` texels along an axis. Its first brick is empty. Where it would take
    /// more than so many bytes, the bricks that count least are coarser ([`chosen`]): of the device's memory, with what
    /// gradients take.
    pub(super) fn atlas(&self, edge: u32, budget: Option<(u64, &SeenSize<'_>)>) -> Result<Atlas> {
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
        let kept: Vec<UVec3> = (0..count)
            .into_par_iter()
            .map(brick_of)
            .filter(|&brick| {
                let node = Node { level: 0, brick: brick.to_array() };
                sampled(brick) && Self::aproned(node).any(|voxel| self.at(voxel) != self.empty)
            })
            .collect();
        let most_along = (edge / APRONED as u32).min(MOST_ALONG);
        let nodes = match budget {
            Some((bytes, seen)) => {
                let texel = TEXEL_BYTES + if self.labels.is_some() { LABEL_BYTES } else { 0 };
                let most = bytes / (texel * APRONED.pow(3) as u64);
                let most = places_within(most.min(u64::from(u32::MAX)) as u32, most_along);
                chosen(&kept, most, &|brick| self.contrast(brick), seen)
            }
            None => chosen(&kept, usize::MAX, &|_| EVEN, &|_, _| 0.0),
        };
        let has_levels = nodes.iter().any(|node| node.level > 0);
        let bricks = atlas_bricks(nodes.len() as u32 + 1, most_along)?;
        let place = |i: u32| {
            let [x, y] = [bricks[0], bricks[1]];
            [i % x, i / x % y, i / (x * y)]
        };
        let mut places = vec![0; count as usize];
        let mut brick_at = vec![NOWHERE; bricks.iter().map(|&n| n as usize).product()];
        let mut levels = has_levels.then(|| vec![0; count as usize]);
        for (to, node) in (1..).zip(&nodes) {
            let [x, y, z] = place(to);
            let brick = UVec3::from_array(node.brick);
            brick_at[to as usize] = brick.extend(node.level).to_array();
            let told = x
                | y << glsl::PLACE_BITS
                | z << (2 * glsl::PLACE_BITS)
                | node.level << (3 * glsl::PLACE_BITS);
            let edge = 1 << node.level;
            for i in 0..edge * edge * edge {
                let one = brick + UVec3::new(i % edge, i / edge % edge, i / (edge * edge));
                if one.cmplt(n).all() {
                    places[place_of(n, one)] = told;
                    if let Some(levels) = &mut levels {
                        levels[place_of(n, one)] = node.level as u8;
                    }
                }
            }
        }
        let size = bricks.map(|n| n * APRONED as u32);
        let [width, height, depth] = size.map(|n| n as usize);
        let mut texels = vec![self.empty; width * height * depth];
        let mut labels = self.labels.as_ref().map(|_| vec![[self.label, ALONE]; texels.len()]);
        // A layer of bricks at a time.
        let (nodes, place) = (&nodes, &place);
        let layer = width * height * APRONED;
        let in_layer = (bricks[0] * bricks[1]) as usize;
        // The bricks of a layer, each with the places of its texels in the layer.
        let in_layer = |z: usize| {
            let numbers = (z * in_layer).max(1)..((z + 1) * in_layer).min(nodes.len() + 1);
            numbers.map(move |to| {
                let [x, y, _] = place(to as u32).map(|v| v as usize * APRONED);
                let texel = move |i: usize| {
                    let [dx, dy, dz] = [i % APRONED, i / APRONED % APRONED, i / (APRONED * APRONED)];
                    (dz * height + y + dy) * width + x + dx
                };
                (nodes[to - 1], texel)
            })
        };
        texels.par_chunks_mut(layer).enumerate().for_each(|(z, texels)| {
            for (node, texel) in in_layer(z) {
                for (i, voxel) in Self::aproned(node).enumerate() {
                    texels[texel(i)] = self.texel(voxel, node.stride()).0;
                }
            }
        });
        if let Some(to) = &mut labels {
            to.par_chunks_mut(layer).enumerate().for_each(|(z, to)| {
                for (node, texel) in in_layer(z) {
                    let voxels = Self::aproned(node).map(|voxel| {
                        let ([_, o], label) = self.texel(voxel, node.stride());
                        (label, o > 0)
                    });
                    let told = cells(&voxels.collect::<Vec<_>>());
                    told.into_iter().enumerate().for_each(|(i, told)| to[texel(i)] = told);
                }
            });
        }
        Ok(Atlas { size, places, bricks: brick_at, levels, texels, labels })
    }
}

/// Returns for each texel of a brick with its apron the label, and [`ALONE`] if all in the cell from it to the next texels
/// has that label. `voxels` are their labels, and whether anything is there; what is not there takes a label beside it.
fn cells(voxels: &[(u8, bool)]) -> Vec<[u8; 2]> {
    const LAST: usize = APRONED - 1;
    let corners = |i: usize| {
        let at = [i % APRONED, i / APRONED % APRONED, i / (APRONED * APRONED)];
        let next = move |corner: usize, axis: usize| (at[axis] + (corner >> axis & 1)).min(LAST);
        (0..8).map(move |c| (next(c, 2) * APRONED + next(c, 1)) * APRONED + next(c, 0))
    };
    let mut labels: Vec<Option<u8>> = voxels.iter().map(|&(label, there)| there.then_some(label)).collect();
    for i in 0..voxels.len() {
        let mut there = corners(i).filter(|&j| voxels[j].1).map(|j| voxels[j].0);
        let Some(first) = there.next() else { continue };
        if there.all(|label| label == first) {
            corners(i).for_each(|j| _ = labels[j].get_or_insert(first));
        }
    }
    let label = |i: usize| labels[i].unwrap_or(voxels[i].0);
    (0..voxels.len())
        .map(|i| [label(i), if corners(i).all(|j| label(j) == label(i)) { ALONE } else { 0 }])
        .collect()
}

/// Returns the most bricks, besides the empty one, whose atlas has at most `most` places.
fn places_within(most: u32, most_along: u32) -> usize {
    let takes = |count: u32| atlas_bricks(count + 1, most_along).map_or(u32::MAX, |[x, y, z]| x * y * z);
    let mut count = most.saturating_sub(1);
    while count > 0 && takes(count) > most {
        count -= 1 + (takes(count) - most) / 2;
    }
    count as usize
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the labels, a cell that says it has one label has no other where anything is.
    #[test]
    fn a_cell_is_alone_if_all_that_is_there_has_one_label() {
        let at = |x: usize, y: usize, z: usize| (z * APRONED + y) * APRONED + x;
        // Two objects side by side along x with nothing above them, and one more in a corner of that.
        let voxel = |i: usize| {
            let [x, z] = [i % APRONED, i / (APRONED * APRONED)];
            (if x < 4 { 5 } else { 9 }, z < 3)
        };
        let mut voxels: Vec<(u8, bool)> = (0..APRONED.pow(3)).map(voxel).collect();
        voxels[at(8, 8, 8)] = (77, true);
        let told = cells(&voxels);
        assert_eq!(told[at(1, 1, 1)], [5, ALONE], "within an object");
        assert_eq!(told[at(1, 1, 2)], [5, ALONE], "at its border on nothing");
        assert_eq!(told[at(3, 1, 1)], [5, 0], "between two objects");
        assert_eq!(told[at(4, 1, 1)], [9, ALONE]);
        assert_eq!(told[at(8, 8, 8)], [77, ALONE], "at the end of the brick");
        let corners = |x: usize, y: usize, z: usize| {
            (0..8).map(move |c| at((x + (c & 1)).min(8), (y + (c >> 1 & 1)).min(8), (z + (c >> 2)).min(8)))
        };
        for i in 0..voxels.len() {
            let [x, y, z] = [i % APRONED, i / APRONED % APRONED, i / (APRONED * APRONED)];
            let there = || corners(x, y, z).filter(|&j| voxels[j].1);
            if told[i][1] == ALONE {
                assert!(there().all(|j| voxels[j].0 == told[i][0]), "{x} {y} {z}");
            }
            assert!(!voxels[i].1 || told[i][0] == voxels[i].0, "labels of what is there stay");
        }
        assert!(told.iter().filter(|told| told[1] == ALONE).count() > 500);
    }
}
