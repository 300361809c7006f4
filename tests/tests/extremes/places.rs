//! Where the patient lies, in which unit, and how the voxels lie in the world.

use engine::fit::evaluate::Sampler;
use engine::splat::activation::Activations;
use engine::splat::{Kernel, Splat, SplatSet};
use engine::volume::bricks::SAMPLES;
use engine::volume::{BetweenSlices, Bricks};
use glam::{DAffine3, DMat3, DVec3, IVec3, UVec3};
use reference::{splat_bounds, splat_to_volume};
use vgs_tests::Device;
use vgs_tests::fitting::Case;
use vgs_tests::numerics::keep;
use vgs_tests::sampling::{field, some_splats};

/// The splats of a fit and its loss after some iterations.
fn fitted(gpu: &Device, case: &Case) -> (Vec<Splat>, Vec<f64>, f32) {
    let mut fitter = case.fitter(gpu, &case.start());
    let mut curve = Vec::new();
    for end in [1, 4, 8, 12] {
        case.run(&mut fitter, end);
        let progress = fitter.progress().expect("progress");
        curve.extend([progress.mse, progress.occupancy_rmse]);
    }
    (fitter.splats().expect("splats"), curve, fitter.scaling().background)
}

#[test]
fn n12_and_n13_places_and_units() {
    let gpu = Device::boot();
    let mut case = Case::phantom([28, 26, 30], 12);
    // Slices of 10 mm would get others between them.
    case.config.samples.between_slices = BetweenSlices::Linear;
    let moved = |world_from_voxel| {
        let mut moved = case.clone();
        moved.volume.world_from_voxel = world_from_voxel;
        fitted(&gpu, &moved)
    };
    let at = case.volume.world_from_voxel;
    let (expected, curve, background) = fitted(&gpu, &case);
    let field = case.config.field(background);
    let here = SplatSet::from_voxel(&expected, &at, field);
    let (mut differ, mut apart) = (0, 0.0f64);
    for shift in [DVec3::new(1e5, -1e5, 1e5), DVec3::new(-1e5, 1e5, 0.0), DVec3::new(1e7, 0.0, -1e7)] {
        let there = DAffine3 { translation: at.translation + shift, ..at };
        let (splats, ..) = moved(there);
        differ += splats.iter().zip(&expected).filter(|(a, b)| a != b).count();
        let set = SplatSet::from_voxel(&splats, &there, field);
        let mean =
            |set: &SplatSet, i: usize| DVec3::from_array(set.splats[i].mean.map(f64::from)) + set.origin_mm;
        for i in 0..splats.len() {
            let error = (mean(&set, i) - shift - mean(&here, i)).abs().max_element();
            apart = apart.max(error / (1e-9 * shift.length() + 1e-6));
        }
    }
    keep("N12a", differ as f64);
    keep("N12b", apart);
    let mut change = 0.0f64;
    for spacing in [DVec3::splat(0.01), DVec3::ONE, DVec3::splat(10.0), DVec3::new(0.3, 0.3, 10.0)] {
        let (_, other, _) = moved(DAffine3::from_scale(spacing));
        for (a, b) in other.iter().zip(&curve) {
            change = change.max((a / b - 1.0).abs());
        }
    }
    keep("N13", change);
}

fn affines() -> [DAffine3; 3] {
    let oblique = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 37f64.to_radians());
    let spacing = DMat3::from_diagonal(DVec3::new(0.7, 0.8, 1.5));
    let left = DMat3::from_diagonal(DVec3::new(-0.9, 0.9, 0.9));
    let shear = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(0.0, 15f64.to_radians().tan(), 1.0));
    [oblique * spacing, left, shear * spacing]
        .map(|matrix| DAffine3::from_mat3_translation(matrix, DVec3::new(-120.5, 33.25, -700.0)))
}

#[test]
fn n14_oblique_left_handed_and_sheared() {
    let gpu = Device::boot();
    let splats = some_splats(14, 80);
    let field = field(Kernel::Compact, 500.0);
    let (mut covariance_off, mut field_off) = (0.0f64, 0.0f64);
    for affine in affines() {
        let set = SplatSet::from_voxel(&splats, &affine, field);
        let covariance = |s: &Splat| {
            let root =
                s.axes() * DMat3::from_diagonal(DVec3::from_array(s.log_scale.map(|l| f64::from(l).exp())));
            root * root.transpose()
        };
        let norm = |m: DMat3| m.to_cols_array().iter().map(|v| v * v).sum::<f64>().sqrt();
        for (voxel, world) in splats.iter().zip(&set.splats) {
            let wanted = affine.matrix3 * covariance(voxel) * affine.matrix3.transpose();
            covariance_off = covariance_off.max(norm(covariance(world) - wanted) / norm(wanted));
        }
        // A straight grid of 1 mm in the middle of the splats.
        let middle = affine.transform_point3(DVec3::new(10.0, 8.0, 6.0)).round();
        let straight = DAffine3::from_translation(middle - 8.0);
        let bricks = Bricks::of_box(IVec3::ZERO, UVec3::splat(16), |_| true);
        let mut sampler = Sampler::new(&gpu, &set.to_voxel(&straight), &field, &bricks).expect("a sampler");
        let got = sampler.sample([0.0; 3]).expect("samples");
        let footprints: Vec<_> = splats
            .iter()
            .map(|s| {
                splat_bounds::footprint(
                    &(&Splat { intensity: s.intensity - 500.0, ..*s }).into(),
                    Kernel::Compact,
                )
            })
            .collect();
        let places: Vec<DVec3> = (0..got.len())
            .map(|i| straight.transform_point3(bricks.voxel(i / SAMPLES, i % SAMPLES).as_dvec3()))
            .map(|world| affine.inverse().transform_point3(world))
            .collect();
        let wanted =
            splat_to_volume::splat_to_volume(&footprints, &places, Kernel::Compact, f64::from(field.epsilon));
        let squares: f64 =
            got.iter().zip(&wanted).map(|(g, w)| (f64::from(g.hu) - 500.0 - w.value).powi(2)).sum();
        let covered = wanted.iter().filter(|w| w.weight > 0.1).count();
        assert!(covered > got.len() / 3, "the splats cover the grid: {covered} of {}", got.len());
        field_off = field_off.max((squares / got.len() as f64).sqrt() / 4000.0);
    }
    keep("N14a", covariance_off);
    keep("N14b", field_off);
}
