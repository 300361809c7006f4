//! What is said about a field: uncovered voxels, PSNR over a range with metal, regions of 1 to 10⁸ voxels.

use engine::fit::errors::ErrorMap;
use engine::fit::evaluate::{Protocol, evaluate};
use engine::passes::loss::Weighted;
use engine::splat::{Field, Kernel, Splat};
use engine::volume::bricks::SAMPLES;
use engine::volume::{Bricks, Roi, Volume};
use glam::{DAffine3, IVec3, UVec3};
use rand::RngExt;
use reference::loss::{self, Numbers, Term};
use shaders_glsl::types::Target;
use vgs_tests::numerics::keep;
use vgs_tests::sampling::{field, one};
use vgs_tests::scene::{random, splat};
use vgs_tests::{Device, step};

/// A volume of side `n` of these values.
fn cube(n: usize, value: impl Fn(usize) -> f32) -> Volume {
    Volume::new([n; 3], DAffine3::IDENTITY, (0..n * n * n).map(value).collect())
}

fn whole(volume: &Volume) -> Roi {
    Roi::new(vec![1.0; volume.len()], volume).expect("a region")
}

#[test]
fn n7_uncovered_voxels_are_counted() {
    let gpu = Device::boot();
    let volume = cube(12, |_| 10.0);
    let roi = whole(&volume);
    // σ = 1 at a voxel reaches those nearer than √6: 81 of the grid of integers. Exactly on the rim there is none.
    let splat = one([6.0; 3], [0.0; 3], 0.0, 10.0);
    let reached = (-3i32..=3)
        .flat_map(|x| (-3i32..=3).flat_map(move |y| (-3i32..=3).map(move |z| x * x + y * y + z * z)))
        .filter(|&squared| squared < 6)
        .count();
    let map = ErrorMap::new(&gpu, &[splat], &field(Kernel::Compact, 10.0), &volume, &roi).expect("a map");
    let mut wrong = map.uncovered.abs_diff(volume.len() - reached);
    let none = ErrorMap::new(&gpu, &[], &field(Kernel::Compact, 10.0), &volume, &roi).expect("a map");
    wrong += none.uncovered.abs_diff(volume.len());
    wrong += none.hu.iter().filter(|v| **v != 0.0).count();
    keep("N7b", wrong as f64);
}

#[test]
fn n25_the_range_of_a_psnr() {
    let gpu = Device::boot();
    let wide = one([6.0; 3], [5.0; 3], 5.0, 100.0);
    let flat = Field { epsilon: 0.0, ..field(Kernel::Compact, 100.0) };
    // 100 HU everywhere, and metal in every hundredth voxel.
    let volume = cube(12, |i| if i % 100 == 0 { 30_000.0 } else { 90.0 });
    let metal = volume.samples.iter().filter(|v| **v > 1e4).count() as f64;
    let count = volume.len() as f64;
    let mut off = 0.0f64;
    for range in [[90.0f32, 30_000.0], [-1024.0, 3071.0]] {
        let protocol = Protocol { offsets: vec![], range, shell: 1, threshold: 0.0 };
        let e = evaluate(&gpu, &[wide], &flat, &volume, &whole(&volume), &protocol).expect("an evaluation");
        assert_eq!(e.range, range, "the range is told");
        let top = 30_000f64.min(f64::from(range[1]));
        let mse = (metal * (top - 100.0).powi(2) + (count - metal) * 100.0) / count;
        let span = f64::from(range[1] - range[0]);
        off = off.max((e.on_grid.psnr_db - 10.0 * (span * span / mse).log10()).abs());
    }
    keep("N25a", off);
    let exact = cube(12, |_| 100.0);
    let protocol = Protocol { offsets: vec![[0.2; 3]], range: [-1024.0, 3071.0], shell: 1, threshold: 0.0 };
    let e = evaluate(&gpu, &[wide], &flat, &exact, &whole(&exact), &protocol).expect("an evaluation");
    let finite = [e.on_grid.psnr_db, e.worst_psnr_db()].iter().filter(|v| **v != f64::INFINITY).count();
    keep("N25b", finite as f64);
}

#[test]
fn n26_small_and_large_regions() {
    let gpu = Device::boot();
    let mut off = 0.0f64;
    for size in [[1, 1, 1], [2, 1, 1], [1000, 1000, 100]] {
        let count: usize = size.iter().product();
        let volume = Volume::new(size, DAffine3::IDENTITY, vec![0.0; count]);
        let roi = Roi::new(vec![1.0; count], &volume).expect("a region");
        off = off.max((roi.weight_sum() - count as f64).abs());
    }
    keep("N26a", off);
    let mut rng = random(26);
    let mut sum_off = 0.0f64;
    for extent in [UVec3::ONE, UVec3::new(2, 1, 1), UVec3::splat(96)] {
        let bricks = Bricks::of_box(IVec3::ZERO, extent, |_| true);
        let splats: Vec<Splat> = (0..40).map(|_| splat(&mut rng, extent.as_vec3())).collect();
        let targets: Vec<Target> = (0..bricks.len() * SAMPLES)
            .map(|i| {
                let value = rng.random_range(-0.5f32..0.5);
                if bricks.is_active(i / SAMPLES, i % SAMPLES) {
                    Target::new(value, 1.0)
                } else {
                    Target::IDLE
                }
            })
            .collect();
        let terms = [Weighted { region: 0.5, ..Weighted::default() }];
        let pass = step::run_with(&gpu, &bricks, &splats, &targets, Kernel::Compact, [0.0; 3], &terms);
        let targets: Vec<reference::Target> = targets.iter().map(Into::into).collect();
        let got: Vec<reference::Reconstruction> = pass.reconstructions.iter().map(Into::into).collect();
        let wanted = loss::sums(
            &Term::new("mse", Numbers { region: 0.5, ..Numbers::default() }),
            &targets,
            &got,
            targets.len(),
        );
        assert_eq!(pass.sums[0].weight, wanted[0][1], "Σ m");
        sum_off = sum_off.max((pass.sums[0].value / wanted[0][0] - 1.0).abs());
    }
    keep("N26b", sum_off);
}
