//! What 16 bytes a splat cost: the field of a packed set against that of the same set in full.

use std::path::Path;

use engine::fit::evaluate::Sampler;
use engine::fit::{FitConfig, FitForm};
use engine::splat::{Activations, Packed, Splat, SplatSet};
use engine::volume::bricks::SAMPLES;
use engine::volume::{Bricks, LabelChoice, Roi, Volume};
use vgs_tests::Device;
use vgs_tests::fitting::Case;

/// Between the voxels, where a fit was not looked at either.
const OFFSET: [f32; 3] = [0.21, -0.33, 0.4];

/// PSNR in dB of the packed field in the region: V̂ over the range of the volume, and the occupancy.
fn psnr(gpu: &Device, set: &SplatSet, volume: &Volume, roi: &Roi) -> [f64; 2] {
    let bricks = Bricks::around(roi, 0);
    let sample = |splats: Vec<Splat>| {
        let local = SplatSet { splats, ..set.clone() }.to_voxel(&volume.world_from_voxel);
        let mut sampler = Sampler::new(gpu, &local, &set.field, &bricks).expect("a sampler");
        sampler.sample(OFFSET).expect("samples")
    };
    let packed = Packed::new(&set.splats, None);
    let (full, got) = (sample(set.splats.clone()), sample(packed.unpack_all()));
    let (mut count, mut hu, mut occupancy) = (0.0, 0.0, 0.0);
    for slot in 0..bricks.len() {
        let inside = bricks.map_samples(slot..slot + 1, false, |voxel| roi.trilinear(voxel.as_dvec3()) > 0.5);
        let at = slot * SAMPLES..(slot + 1) * SAMPLES;
        for ((a, b), _) in full[at.clone()].iter().zip(&got[at]).zip(inside).filter(|(_, inside)| *inside) {
            count += 1.0;
            hu += f64::from(a.hu - b.hu).powi(2);
            occupancy += f64::from(a.occupancy - b.occupancy).powi(2);
        }
    }
    let (low, high) = volume.min_max().expect("samples");
    let span = f64::from(high - low);
    assert!(count > 0.0 && hu > 0.0, "packing is not free");
    println!(
        "{} splats, {} bytes, {count} samples: {:.2} HU (root mean square)",
        packed.len(),
        packed.bytes(),
        (hu / count).sqrt()
    );
    [hu / count / span.powi(2), occupancy / count].map(|mse| -10.0 * mse.log10())
}

/// Prints the root mean square errors of the parameters.
fn print_errors(set: &SplatSet) {
    let packed = Packed::new(&set.splats, None);
    let (mut mean, mut relative, mut intensity, mut opacity) = (0.0, 0.0, 0.0, 0.0);
    for (row, &from) in packed.order.iter().enumerate() {
        let (a, b) = (&set.splats[from as usize], packed.unpack(row));
        for k in 0..3 {
            mean += f64::from(a.mean[k] - b.mean[k]).powi(2) / f64::from(a.scale()[k]).powi(2);
            relative += f64::from(a.log_scale[k] - b.log_scale[k]).powi(2) / 3.0;
        }
        intensity += f64::from(a.intensity - b.intensity).powi(2);
        opacity += f64::from(a.opacity() - b.opacity()).powi(2);
    }
    let rms = |sum: f64| (sum / packed.len() as f64).sqrt();
    println!(
        "mean {:.5} σ, scale {:.3} %, intensity {:.4} HU, opacity {:.5}",
        rms(mean),
        100.0 * rms(relative),
        rms(intensity),
        rms(opacity)
    );
}

/// Fits a case; returns the PSNR of V and of O of the packed splats against those in full, dB.
fn of_fit(gpu: &Device, case: &Case) -> [f64; 2] {
    let mut fitter = case.fit(gpu);
    let splats = fitter.splats().expect("splats");
    let field = case.config.field(fitter.scaling().background);
    let set = SplatSet::from_voxel(&splats, &case.volume.world_from_voxel, field);
    print_errors(&set);
    psnr(gpu, &set, &case.volume, &case.roi)
}

#[test]
fn a_packed_fit_shows_the_same_field() {
    let gpu = Device::boot();
    for (form, least_hu) in [(FitForm::Grid, 61.0), (FitForm::Field, 66.0)] {
        let mut case = Case::phantom([40, 36, 40], 60);
        case.config.samples.form = form;
        let [hu, occupancy] = of_fit(&gpu, &case);
        println!("{form:?}: {hu:.2} dB, occupancy {occupancy:.2} dB");
        assert!(hu > least_hu && occupancy > 58.0, "{form:?}: {hu} dB, {occupancy} dB");
    }
}

/// The same for a CT, of 0.05 splats a voxel.
#[test]
fn a_packed_fit_of_a_ct_shows_the_same_field() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/ct-torso-tiny"));
    if !folder.is_dir() {
        println!("SKIPPED: no real data: ../shared/data/ct-torso-tiny is not there");
        return;
    }
    let gpu = Device::boot();
    let read =
        |name: &str| Volume::read(folder.join(name), &engine::volume::ReadOptions::default()).expect(name);
    let (volume, mask) = (read("ct.nii.gz"), read("mask_ts.nii.gz"));
    let roi = Roi::from_mask(&mask, &LabelChoice::Whole, &volume).expect("a region");
    let config = FitConfig::default().with(|c| {
        c.iterations = 40;
        c.count.density = 0.05;
    });
    let case = Case { volume, roi, config };
    let [hu, occupancy] = of_fit(&gpu, &case);
    println!("{hu:.2} dB, occupancy {occupancy:.2} dB");
    assert!(hu > 72.0 && occupancy > 59.0, "{hu} dB, {occupancy} dB");
}
