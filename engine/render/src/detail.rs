//! Which bricks of a decoded field the device has whole, where its memory is not for all of them: those that have much to
//! show, and are seen and near, come first. All others are there in coarser ones, so that nowhere is a hole.
//!
//! A brick of level l stands for 2^l bricks along each axis, has as many texels as any other, and takes every 2^l-th voxel:
//! the mean around it, by a tent that ends at the next ones.

use std::collections::{BTreeMap, BinaryHeap};

use glam::{DVec2, DVec3, IVec3, UVec3};
use rayon::prelude::*;
use shaders_glsl::medium::MOST_LEVEL;

use super::camera::{Camera, Fov};
use super::decoded::Decoded;
use volume::bricks::{BRICK, SAMPLES, brick_voxel};

/// The memory of the device that is for a decoded field, and from where the field is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldBudget {
    /// Most bytes, but for what a driver adds to images; the coarsest bricks are there even if they take more.
    pub bytes: u64,
    /// The eye, in the world, mm RAS; `None` if the field may be seen from anywhere.
    pub camera: Option<Camera>,
}

/// What a brick that is out of sight counts of one that is seen: the eye may turn.
const UNSEEN: f64 = 1.0 / 64.0;

/// The contrast of a brick that is the same all over.
pub(super) const EVEN: f64 = 1e-3;

/// A brick of some level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Node {
    pub(super) level: u32,
    /// The first brick of the grid that it stands for.
    pub(super) brick: [u32; 3],
}

impl Node {
    /// Returns the distance of its texels, voxels.
    pub(super) fn stride(self) -> i32 {
        1 << self.level
    }

    /// Returns the voxel of its first texel.
    pub(super) fn first_voxel(self) -> IVec3 {
        (UVec3::from_array(self.brick) * BRICK as u32).as_ivec3() - 1
    }
}

/// Returns the bricks for at most `most` places, of which `kept` hold anything; the coarsest ones even if they are more.
/// Where not all are whole, `contrast` is asked for that of each, above 0, and `seen` how large a brick is seen, by its
/// middle and radius, voxels of the box.
pub(super) fn chosen(
    kept: &[UVec3],
    most: usize,
    contrast: &(dyn Fn(UVec3) -> f64 + Sync),
    seen: &dyn Fn(DVec3, f64) -> f64,
) -> Vec<Node> {
    if kept.len() <= most {
        return kept.iter().map(|brick| Node { level: 0, brick: brick.to_array() }).collect();
    }
    let contrasts: Vec<f64> = kept.par_iter().map(|&brick| contrast(brick)).collect();
    // By level, the first bricks of those that hold anything, with the contrast of all.
    let levels: Vec<BTreeMap<[u32; 3], f64>> = (0..=MOST_LEVEL)
        .map(|level| {
            let mut sums = BTreeMap::new();
            for (&brick, contrast) in kept.iter().zip(&contrasts) {
                *sums.entry((brick >> level << level).to_array()).or_default() += contrast;
            }
            sums
        })
        .collect();
    // The greatest priority first; of equals any, but always the same.
    let queued = |node: Node| {
        let half = 0.5 * f64::from(BRICK as i32 * node.stride());
        let middle = node.first_voxel().as_dvec3() + half;
        let radius = half * 3f64.sqrt();
        // As many of its bricks have something in a surface.
        let bricks = f64::from(node.stride()).powi(2);
        // What is near hides what is far, so contrast counts little beside it: as measured on bones and on organs.
        let contrast = (levels[node.level as usize][&node.brick] / bricks).powf(0.25);
        ((seen(middle, radius) * contrast).to_bits(), node)
    };
    let coarsest = levels[MOST_LEVEL as usize].keys().map(|&brick| Node { level: MOST_LEVEL, brick });
    let mut waiting: BinaryHeap<(u64, Node)> = coarsest.map(queued).collect();
    let mut count = waiting.len();
    let mut made = Vec::new();
    while let Some((_, node)) = waiting.pop() {
        let finer: Vec<Node> = match node.level {
            0 => Vec::new(),
            level => (0..8)
                .map(|corner| UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2) << (level - 1))
                .map(|shift| (UVec3::from_array(node.brick) + shift).to_array())
                .filter(|brick| levels[level as usize - 1].contains_key(brick))
                .map(|brick| Node { level: level - 1, brick })
                .collect(),
        };
        if finer.is_empty() || count + finer.len() - 1 > most {
            made.push(node);
        } else {
            count += finer.len() - 1;
            waiting.extend(finer.into_iter().map(queued));
        }
    }
    made.sort_unstable();
    made
}

/// Returns how large a ball is seen by a camera: by its angle, and less if it is out of sight. All are in the space of the
/// camera's eye. Never negative.
pub(super) fn seen_size(camera: &Camera, eye: DVec3, middle: DVec3, radius: f64) -> f64 {
    let away = middle - eye;
    let distance = away.length();
    if distance <= radius {
        return 1.0;
    }
    let Fov { left, right, up, down } = camera.fov;
    // The cone around the picture.
    let cone = left.abs().max(right.abs()).hypot(up.abs().max(down.abs())).atan();
    let angle = (away.dot(camera.forward()) / distance).clamp(-1.0, 1.0).acos();
    let own = (radius / distance).asin();
    let size = radius / distance;
    if angle - own > cone { UNSEEN * size } else { size }
}

impl Decoded {
    /// Returns how much V and O differ from voxel to voxel in a brick: a sum of squares, V as fractions of its range and
    /// weighted by O. Never 0, so that what is even counts by its size.
    pub(super) fn contrast(&self, brick: UVec3) -> f64 {
        let whole = f64::from(u16::MAX);
        let shown = |voxel: IVec3| {
            let [v, o] = self.at(voxel).map(|fraction| f64::from(fraction) / whole);
            DVec2::new(o * v, o)
        };
        let first = Node { level: 0, brick: brick.to_array() }.first_voxel();
        let mut sum = EVEN;
        for i in 0..SAMPLES {
            let voxel = first + brick_voxel(i).as_ivec3();
            let here = shown(voxel);
            sum += IVec3::AXES.iter().map(|&axis| (shown(voxel + axis) - here).length_squared()).sum::<f64>();
        }
        sum
    }

    /// Returns V and O as fractions of a texel at a voxel of the box, and its label: what the voxel has, or the means
    /// of all within `stride`. V is weighted by O, so that nothing empty is mixed in.
    pub(super) fn texel(&self, voxel: IVec3, stride: i32) -> ([u16; 2], u8) {
        let label_of = |sample: usize| self.labels.as_ref().map_or(self.label, |labels| labels[sample]);
        if stride == 1 {
            let found = self.sample(voxel);
            return (found.map_or(self.empty, |i| self.samples[i]), found.map_or(self.label, label_of));
        }
        // Sums over all voxels: of the weights, of V, of O, and of V weighted by O.
        let (mut sum, mut v_sum, mut o_sum, mut weighted) = (0u64, 0u64, 0u64, 0u64);
        let mut shares = [0u64; 256];
        let reach = stride - 1;
        for z in -reach..=reach {
            for y in -reach..=reach {
                for x in -reach..=reach {
                    let part = |d: i32| (stride - d.abs()) as u64;
                    let weight = part(x) * part(y) * part(z);
                    let (v, o, label) = match self.sample(voxel + IVec3::new(x, y, z)) {
                        Some(i) => (self.samples[i][0], self.samples[i][1], label_of(i)),
                        None => (self.empty[0], self.empty[1], self.label),
                    };
                    let (v, o) = (u64::from(v), weight * u64::from(o));
                    sum += weight;
                    v_sum += weight * v;
                    o_sum += o;
                    weighted += o * v;
                    shares[usize::from(label)] += o;
                }
            }
        }
        if o_sum == 0 {
            return ([((v_sum + sum / 2) / sum) as u16, 0], self.label);
        }
        let most = (0..=u8::MAX).max_by_key(|&label| (shares[usize::from(label)], 255 - label));
        let v = (weighted + o_sum / 2) / o_sum;
        ([v as u16, o_sum.div_ceil(sum) as u16], most.unwrap_or(self.label))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use glam::DAffine3;

    use super::*;
    use crate::scale::Scale;

    /// Whatever the room, each brick that holds anything is in one that was chosen, and no two of these overlap.
    #[test]
    fn bricks_that_are_chosen_cover_all_once_and_near_ones_are_whole() {
        let kept: Vec<UVec3> = (0..20 * 17 * 9)
            .map(|i| UVec3::new(i % 20, i / 20 % 17, i / 340))
            .filter(|brick| (brick.x * 7 + brick.y * 3 + brick.z * 5) % 4 != 0)
            .collect();
        let eye = DVec3::new(100.0, 20.0, 30.0);
        let near = |middle: DVec3, radius: f64| radius / (middle - eye).length().max(radius);
        for most in [kept.len(), kept.len() - 1, 900, 300, 80, 24, 1] {
            let nodes = chosen(&kept, most, &|_| 1.0, &near);
            let holds = |node: &Node, brick: UVec3| {
                brick >> node.level << node.level == UVec3::from_array(node.brick)
            };
            for &brick in &kept {
                assert_eq!(nodes.iter().filter(|node| holds(node, brick)).count(), 1, "{brick} of {most}");
            }
            let coarsest =
                kept.iter().map(|&brick| (brick >> MOST_LEVEL).to_array()).collect::<BTreeSet<_>>();
            assert!(nodes.len() <= most.max(coarsest.len()), "{} of {most}", nodes.len());
            assert!(nodes.len() + 7 > most || most < coarsest.len(), "{} of {most}", nodes.len());
            assert_eq!(nodes, chosen(&kept, most, &|_| 1.0, &near), "always the same");
            if most >= 300 {
                let under_eye = ((eye + 1.0) / BRICK as f64).as_uvec3();
                let around = kept.iter().find(|brick| **brick == under_eye).expect("a brick");
                assert!(nodes.contains(&Node { level: 0, brick: around.to_array() }), "near, of {most}");
            }
        }
    }

    #[test]
    fn what_is_out_of_sight_counts_less() {
        let fov = Fov::symmetric(40.0, 1.5);
        let camera = Camera { eye: DVec3::splat(9e9), right: DVec3::X, up: DVec3::Y, fov };
        let size = |middle: DVec3| seen_size(&camera, DVec3::ZERO, middle, 1.0);
        let ahead = camera.forward() * 10.0;
        assert_eq!(size(ahead), 0.1);
        assert_eq!(size(2.0 * ahead), 0.05);
        assert_eq!(size(-ahead), 0.1 * UNSEEN);
        assert!(size(ahead + DVec3::X * 5.0) > 0.05, "at the right edge");
        assert_eq!(size(DVec3::X / 2.0), 1.0, "the eye is in it");
    }

    /// What has much to show is whole, what is even is coarse.
    #[test]
    fn contrast_comes_first() {
        let at = |i: u32| UVec3::new(i % 8, i / 8 % 8, i / 64);
        let kept: Vec<_> = (0..512).map(at).collect();
        let contrast = |brick: UVec3| if brick == at(77) { 1.0 } else { EVEN };
        let nodes = chosen(&kept, 22, &contrast, &|_, radius| radius);
        assert_eq!(nodes.len(), 22);
        assert!(nodes.contains(&Node { level: 0, brick: at(77).to_array() }));
    }

    /// A texel of a coarser brick has the means around it: of what is linear, what is there.
    #[test]
    fn texels_are_means() {
        let n = UVec3::splat(4);
        let value = |at: IVec3| (1000 + 300 * at.x + 50 * at.y - 20 * at.z) as u16;
        let mut field = Decoded {
            size: [30; 3],
            scene_from_voxel: DAffine3::IDENTITY,
            edge_mm: 1.0,
            scale: Scale::of([0.0, 65535.0], Some(1.0)),
            empty: [7, 0],
            bricks: n,
            slots: (0..n.element_product()).collect(),
            samples: vec![[0, 0]; n.element_product() as usize * SAMPLES],
            labels: Some(vec![3; n.element_product() as usize * SAMPLES]),
            label: 0,
        };
        let all = (0..n.element_product()).flat_map(|i| {
            let brick = UVec3::new(i % n.x, i / n.x % n.y, i / (n.x * n.y));
            (0..SAMPLES)
                .map(move |m| ((i as usize) * SAMPLES + m, (brick * 8 + brick_voxel(m)).as_ivec3() - 1))
        });
        for (i, at) in all {
            field.samples[i] = [value(at), 40000];
        }
        let middle = IVec3::splat(15);
        for stride in [1, 2, 4, 8] {
            assert_eq!(field.texel(middle, stride), ([value(middle), 40000], 3), "{stride}");
        }
        // One voxel alone: its share of O, all of V, and its label.
        field.samples.fill([7, 0]);
        let lone = field.sample(middle).expect("a sample");
        field.samples[lone] = [500, 40000];
        field.labels.as_mut().expect("labels")[lone] = 9;
        assert_eq!(field.texel(middle, 1), ([500, 40000], 9));
        assert_eq!(field.texel(middle, 2), ([500, 40000 / 8], 9));
        assert_eq!(field.texel(middle + IVec3::X, 2), ([500, 40000 / 16], 9));
        assert_eq!(field.texel(middle + 2 * IVec3::X, 2), ([7, 0], 0));
        assert_eq!(field.texel(middle, 4), ([500, 40000u16.div_ceil(64)], 9));
    }
}
