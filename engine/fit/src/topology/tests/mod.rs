//! Tests of density control on small worlds whose field is summed plainly, splat by splat and voxel by voxel.

mod densify;
mod residual;

use glam::{DAffine3, DVec3};
use rand::{RngExt, SeedableRng};

use super::densify::densify;
use super::growth::growth;
use super::*;
use crate::evaluate::FieldSample;
use crate::{FitConfig, Scaling};
use splat::Splat;
use splat::activation::Activations;
use splat::{Kernel, defect};
use volume::{Bricks, Roi, Volume};

/// Everything that a [`Scene`] borrows.
struct World {
    volume: Volume,
    roi: Roi,
    config: FitConfig,
    scaling: Scaling,
    splats: Vec<Splat>,
    norms: Vec<f32>,
    bricks: Bricks,
    samples: Vec<FieldSample>,
    share: f64,
    limit: usize,
    scale_range: (f32, f32),
}

const SIZE: [usize; 3] = [30, 26, 22];

impl World {
    /// Creates a volume with an edge and a texture, whose ROI is a ball of radius 9 with that weight.
    fn new(splats: Vec<Splat>, config: FitConfig, weight: f32) -> World {
        let mut samples = Vec::new();
        let mut inside = Vec::new();
        for (x, y, z) in voxels() {
            let edge = if x > 14 { 400.0 } else { 0.0 };
            samples.push(edge + 30.0 * ((x * 7 + y * 5 + z * 3) % 11) as f32);
            let d = DVec3::new(x as f64, y as f64, z as f64) - DVec3::new(15.0, 12.0, 11.0);
            inside.push(if d.length() < 9.0 { weight } else { 0.0 });
        }
        let volume = Volume::new(SIZE, DAffine3::IDENTITY, samples);
        let roi = Roi::new(inside, &volume).expect("a region");
        World::of(volume, roi, splats, config)
    }

    fn of(volume: Volume, roi: Roi, splats: Vec<Splat>, config: FitConfig) -> World {
        let bricks = Bricks::around_and_beyond(&roi, 2);
        let mut world = World {
            scaling: Scaling::new(&volume, &roi, &config),
            norms: vec![0.0; splats.len()],
            limit: 1000 * splats.len(),
            scale_range: (config.scales.min, config.scales.max),
            share: 0.0,
            samples: Vec::new(),
            volume,
            roi,
            config,
            splats,
            bricks,
        };
        world.sum_field();
        world
    }

    fn scene(&self) -> Scene<'_> {
        Scene {
            volume: &self.volume,
            roi: &self.roi,
            config: &self.config,
            scaling: &self.scaling,
            scale_range: self.scale_range,
            splats: &self.splats,
            gradient_norms: &self.norms,
            bricks: &self.bricks,
            samples: &self.samples,
            share: self.share,
            limit: self.limit,
        }
    }

    /// Computes equation (2) at the voxels, with garbage where a sample takes no part.
    fn sum_field(&mut self) {
        let garbage = FieldSample { hu: f32::NAN, occupancy: f32::NAN, weight: f32::NAN };
        self.samples = self.bricks.map_samples(0..self.bricks.len(), garbage, |voxel| {
            let (mut total, mut sum) = (0.0, 0.0);
            let b = f64::from(self.scaling.background);
            for splat in &self.splats {
                let w = weight(splat, voxel.as_dvec3(), self.config.kernel);
                total += w;
                sum += w * (f64::from(splat.intensity) - b);
            }
            let hu = (b + sum / (total + f64::from(self.config.epsilon))) as f32;
            FieldSample { hu, occupancy: 0.0, weight: total as f32 }
        });
    }

    fn roi_indices(&self) -> Vec<usize> {
        let inside = self.scene().map_roi(false, |_, _, _| true);
        (0..inside.len()).filter(|&i| inside[i]).collect()
    }
}

fn voxels() -> impl Iterator<Item = (usize, usize, usize)> {
    let [nx, ny, nz] = SIZE;
    (0..nx * ny * nz).map(move |i| (i % nx, i / nx % ny, i / (nx * ny)))
}

/// Returns w of a splat at a voxel, from the definition.
fn weight(splat: &Splat, x: DVec3, kernel: Kernel) -> f64 {
    let d = x - DVec3::from_array(splat.mean.map(f64::from));
    let u = splat.axes().transpose() * d / DVec3::from_array(splat.scale().map(f64::from));
    peak(splat, kernel) * kernel.value(u.length_squared())
}

fn peak(splat: &Splat, kernel: Kernel) -> f64 {
    f64::from(splat.opacity()) * kernel.peak(splat.log_scale.map(f64::from))
}

fn splat(mean: [f32; 3], scale: f32, opacity: f32) -> Splat {
    let mut splat = Splat { mean, rotation: [1.0, 0.0, 0.0, 0.0], intensity: 100.0, ..Splat::default() };
    splat.set_scale([scale; 3]);
    splat.set_opacity(opacity);
    splat
}

/// Creates `count` splats of all sorts in and near the ball.
fn crowd(count: usize, seed: u64) -> Vec<Splat> {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut number = |low: f32, high: f32| random.random_range(low..high);
    (0..count)
        .map(|_| {
            let mut s =
                splat([number(4.0, 26.0), number(2.0, 22.0), number(1.0, 20.0)], 1.0, number(0.05, 0.95));
            s.set_scale([0; 3].map(|_| number(0.5, 4.0)));
            s.rotation = [0; 4].map(|_| number(-1.0, 1.0));
            s.rotation = splat::activation::normalised(s.rotation);
            s.intensity = number(-100.0, 600.0);
            s
        })
        .collect()
}

fn random() -> Pcg64 {
    Pcg64::seed_from_u64(11)
}

fn bits(splats: &[Splat]) -> &[u32] {
    bytemuck::cast_slice(splats)
}

/// Returns a configuration in which densify may do everything in one change, and finds no holes.
fn open() -> FitConfig {
    FitConfig::default().with(|c| {
        c.topology.share = 1.0;
        c.topology.hole_weight = 0.0;
    })
}

/// Asserts that each row says which old splat it is or that it is new, and that old ones are as they were.
fn assert_consistent(world: &World, change: &Change, name: &str) {
    assert_eq!(change.splats.len(), change.keeps.len(), "{name}");
    assert!(!change.splats.is_empty(), "{name}: a change empties nothing");
    let mut seen = vec![false; world.splats.len()];
    for (splat, keeps) in change.splats.iter().zip(&change.keeps) {
        assert_eq!(defect(splat), None, "{name}: {splat:?}");
        if let Some(old) = keeps {
            assert!(!std::mem::replace(&mut seen[*old as usize], true), "{name}: {old} is kept twice");
            assert_eq!(bits(&[*splat]), bits(&[world.splats[*old as usize]]), "{name}: {old} has changed");
        }
    }
}

#[test]
fn rows_have_names_of_their_own_and_the_first_does_nothing() {
    assert!(TOPOLOGIES[0].change.is_none());
    for (index, row) in TOPOLOGIES.iter().enumerate() {
        assert!(TOPOLOGIES[..index].iter().all(|other| other.name != row.name));
        let config = FitConfig::default().with(|c| c.topology.name = row.name.to_owned());
        config.check().expect("a row is a value of the key");
    }
}

#[test]
fn share_and_limit_are_respected() {
    for (share, extra, transparent) in
        [(0.1, 100, 0), (1.0, 3, 0), (1.0, 0, 0), (0.5, 0, 4), (0.0, 50, 5), (0.04, 50, 0), (1.0, 7, 20)]
    {
        for hole_weight in [0.0, 0.01, 1e9] {
            for (name, change) in
                [("densify", densify as fn(&Scene, &mut Pcg64) -> Change), ("growth", growth)]
            {
                let config = open().with(|c| {
                    c.topology.hole_weight = hole_weight;
                    c.topology.share = share;
                });
                let mut world = World::new(crowd(20, 4), config, 1.0);
                world.splats[..transparent].iter_mut().for_each(|s| s.set_opacity(1e-6));
                world.norms = (0..20).map(|i| i as f32).collect();
                world.limit = 20 + extra;
                let change = change(&world.scene(), &mut random());
                let case = format!("{name}: share {share}, {extra} more, {transparent} transparent");
                assert_consistent(&world, &change, &case);
                let removed = if name == "densify" { transparent } else { 0 };
                let remaining = (20 - removed).max(1);
                let added = change.splats.len() - remaining;
                assert!(added <= (20.0 * share) as usize, "{case}: {added} added");
                assert!(change.splats.len() <= world.limit.max(remaining), "{case}");
                // Growth and a world of holes use all there is.
                if name == "growth" || hole_weight > 1.0 {
                    let room = (world.limit - remaining).min((20.0 * share) as usize);
                    assert_eq!(added, room, "{case}");
                }
            }
        }
    }
}

#[test]
fn extremes_change_nothing_by_accident() {
    let world = |norms: &[f32]| {
        let mut world = World::new(crowd(norms.len(), 6), open(), 1.0);
        world.norms = norms.to_vec();
        world
    };
    // Accumulated norms, and how many splats are refined.
    let nan = f32::NAN;
    let rows: [(&[f32], usize); 7] = [
        (&[0.0; 5], 0),
        (&[2.5; 5], 0),
        (&[nan; 5], 0),
        (&[f32::INFINITY, nan, 1.0, 1.0, f32::NEG_INFINITY], 2),
        (&[nan, 1.0, nan, nan, nan], 1),
        (&[1.0], 0),
        (&[f32::MAX, 0.0], 1),
    ];
    for (norms, refined) in rows {
        let world = world(norms);
        let change = densify(&world.scene(), &mut random());
        assert_consistent(&world, &change, "extremes");
        assert_eq!(change.splats.len(), norms.len() + refined, "{norms:?}");
    }
    // A region of one voxel, exactly reproduced: nothing to grow towards and no hole.
    let mut one = World::new(vec![splat([0.0; 3], 1.0, 0.5)], FitConfig::default(), 1.0);
    one.roi.weight.fill(0.0);
    one.roi.weight[0] = 1.0;
    let intensity = one.volume.samples[0];
    let mut exact = World::of(one.volume, one.roi, vec![splat([0.0; 3], 1.0, 0.5)], open());
    exact.splats[0].intensity = intensity;
    exact.sum_field();
    for row in TOPOLOGIES {
        let Some(change) = row.change else { continue };
        let change = change(&exact.scene(), &mut random());
        assert_eq!((change.splats.len(), &change.keeps[..]), (1, &[Some(0)][..]), "{}", row.name);
    }
}

#[test]
fn new_splats_stay_within_the_clamps() {
    let mut world = World::new(crowd(30, 12), open(), 1.0);
    world.scale_range = (1.5, 2.5);
    world.config.logit_max = 1.0;
    world.config.init.opacity = 0.99;
    world.config.topology.hole_weight = 1e9;
    world.norms = (0..30).map(|i| i as f32).collect();
    world.splats[29].mean = [0.0, 25.0, 0.0];
    world.splats[29].set_scale([10.0; 3]);
    for change in [densify(&world.scene(), &mut random()), growth(&world.scene(), &mut random())] {
        let new: Vec<&Splat> = change
            .splats
            .iter()
            .filter(|s| !bits(&world.splats).chunks(12).any(|old| old == bits(&[**s])))
            .collect();
        assert!(new.len() > 10);
        let low = world.bricks.origin.as_vec3() - 0.5;
        let high = low + (world.bricks.grid * 8).as_vec3();
        for s in new {
            for k in 0..3 {
                assert!((1.4999..2.5001).contains(&s.scale()[k]), "{:?}", s.scale());
                assert!((low[k]..=high[k]).contains(&s.mean[k]), "{:?}", s.mean);
            }
            assert!(s.opacity_logit.abs() <= 1.0);
        }
    }
}

#[test]
fn the_random_numbers_decide_and_the_threads_do_not() {
    let config = FitConfig::default().with(|c| {
        c.topology.share = 0.3;
        c.topology.hole_weight = 0.2;
    });
    let mut world = World::new(crowd(60, 13), config, 1.0);
    world.norms = (0..60).map(|i| ((i * 37) % 60) as f32).collect();
    for row in TOPOLOGIES {
        let Some(change) = row.change else { continue };
        let run = |seed, threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| change(&world.scene(), &mut Pcg64::seed_from_u64(seed)))
        };
        let first = run(1, 1);
        assert!(first.keeps.contains(&None), "{}: something changes", row.name);
        for threads in [1, 2, 5] {
            let again = run(1, threads);
            assert_eq!(bits(&first.splats), bits(&again.splats), "{} on {threads} threads", row.name);
            assert_eq!(first.keeps, again.keeps, "{}", row.name);
        }
        let is_random = ["densify", "reference"].contains(&row.name);
        assert_eq!(bits(&first.splats) != bits(&run(2, 1).splats), is_random, "{}", row.name);
    }
}
