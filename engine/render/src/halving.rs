//! Decoded fields at coarser pitches: voxels of twice the edge, for splats that mean nothing between the voxels
//! of their grid.

use glam::{DAffine3, DVec3, IVec3, UVec3};
use rayon::prelude::*;

use super::decoded::{Decoded, bricks_over};
use volume::bricks::{BRICK, NO_SLOT, SAMPLES, brick_voxel};

impl Decoded {
    /// Returns the field on voxels of twice the edge. Each stands for eight: O is their mean, so that nothing
    /// thin is missed, and V is their mean weighted by O, so that nothing empty is mixed in.
    pub(super) fn halved(&self) -> Self {
        let size = (UVec3::from_array(self.size) + 1) / 2 + 2;
        let bricks = bricks_over(size);
        let count = bricks.element_product();
        let made: Vec<Option<Vec<Halved>>> = (0..count)
            .into_par_iter()
            .map(|i| {
                let brick = UVec3::new(i % bricks.x, i / bricks.x % bricks.y, i / (bricks.x * bricks.y));
                let first = (brick * BRICK as u32).as_ivec3() - 1;
                let all = (0..SAMPLES).map(|m| self.mean_of(first + brick_voxel(m).as_ivec3()));
                let all: Vec<Option<Halved>> = all.collect();
                let none = Halved { sample: self.empty, label: self.label };
                all.iter().any(Option::is_some).then(|| all.iter().map(|h| h.unwrap_or(none)).collect())
            })
            .collect();
        let mut slots = vec![NO_SLOT; count as usize];
        let there = made.iter().enumerate().filter(|(_, made)| made.is_some());
        for (slot, (i, _)) in (0..).zip(there) {
            slots[i] = slot;
        }
        let all = || made.iter().flatten().flatten();
        Decoded {
            size: size.to_array(),
            // Voxel 1 stands for voxels 0 and 1, so that there is an empty border again.
            scene_from_voxel: self.scene_from_voxel
                * DAffine3::from_translation(DVec3::splat(-1.5))
                * DAffine3::from_scale(DVec3::splat(2.0)),
            bricks,
            slots,
            samples: all().map(|h| h.sample).collect(),
            labels: self.labels.as_ref().map(|_| all().map(|h| h.label).collect()),
            ..*self
        }
    }

    /// Returns what the eight voxels have that a voxel of twice the edge stands for; `None` if none of them
    /// is sampled.
    fn mean_of(&self, coarse: IVec3) -> Option<Halved> {
        let first = 2 * (coarse - 1);
        let size = UVec3::from_array(self.size).as_ivec3();
        // Sums over all voxels: of V, of O, and of V weighted by O.
        let (mut sampled, mut v_sum, mut o_sum, mut weighted) = (0u64, 0u64, 0u64, 0u64);
        // O of each object that is met; eight voxels have eight at most.
        let mut shares = [(self.label, 0u64); 8];
        for corner in 0..8 {
            let voxel = first + IVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            if voxel.cmplt(IVec3::ZERO).any() || voxel.cmpge(size).any() {
                continue;
            }
            let Some(i) = self.sample(voxel) else { continue };
            let [v, o] = self.samples[i].map(u64::from);
            sampled += 1;
            v_sum += v;
            o_sum += o;
            weighted += v * o;
            if let Some(labels) = &self.labels {
                let known = shares.iter().position(|(label, share)| *label == labels[i] && *share > 0);
                let free = shares.iter().position(|(_, share)| *share == 0);
                if let Some(place) = known.or(free) {
                    shares[place] = (labels[i], shares[place].1 + o);
                }
            }
        }
        if sampled == 0 {
            return None;
        }
        let rounded = |sum: u64, by: u64| ((sum + by / 2) / by) as u16;
        let v = if o_sum > 0 { rounded(weighted, o_sum) } else { rounded(v_sum, sampled) };
        let label = shares.iter().max_by_key(|(_, share)| *share).map_or(self.label, |(label, _)| *label);
        Some(Halved { sample: [v, rounded(o_sum, 8)], label })
    }
}

/// V, O and the object of a voxel of twice the edge.
#[derive(Clone, Copy)]
struct Halved {
    sample: [u16; 2],
    label: u8,
}
