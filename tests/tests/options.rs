//! Products of options: every way to fit together with every other, on a region that touches every face, edge and corner
//! of its volume. A combination that `vgs fit --help` offers is tried here for some iterations.

use engine::fit::init::{INITIALISERS, ORIENTATIONS};
use engine::fit::topology::TOPOLOGIES;
use engine::fit::{
    Background, FitConfig, FitForm, INTENSITY_LOSSES, IntensityRange, MASK_LOSSES, PROFILES, Profile,
    ScaleUnit, Storage,
};
use engine::splat::defect;
use engine::splat::kernel::KERNELS;
use engine::volume::{Roi, Volume};
use glam::{DAffine3, DMat3, DVec3};
use vgs_tests::Device;
use vgs_tests::fitting::Case;

const SIZE: [usize; 3] = [13, 10, 9];
const SPLATS: usize = 24;

/// Splats of a mini-batch, and whether it is rasterized alone.
const SUBSETS: [(usize, bool); 3] = [(0, true), (7, true), (7, false)];

/// A volume of other spacings along each axis, and a region of pieces at all of its 8 corners, 12 edges and 6 faces.
fn volume_and_region(soft: bool) -> (Volume, Roi) {
    let [nx, ny, nz] = SIZE;
    let voxels = || (0..nx * ny * nz).map(move |i| [i % nx, i / nx % ny, i / (nx * ny)]);
    let value = |[x, y, z]: [usize; 3]| ((x * 37 + y * 91 + z * 53) % 700) as f32 - 300.0 - 60.0 * x as f32;
    let affine = DAffine3 {
        matrix3: DMat3::from_rotation_z(0.3) * DMat3::from_diagonal(DVec3::new(0.7, 1.1, 2.5)),
        translation: DVec3::new(-40.0, 7.0, 900.0),
    };
    let volume = Volume::new(SIZE, affine, voxels().map(value).collect());
    let weight = voxels().map(|voxel| {
        let at = |axis: usize| -> usize {
            let (first, last) = (voxel[axis] < 2, voxel[axis] + 2 >= SIZE[axis]);
            let middle = voxel[axis] == SIZE[axis] / 2;
            if first || last { 2 } else { usize::from(middle) }
        };
        // A piece begins where each coordinate is at an end or in the middle, and at least one is at an end.
        let places = [at(0), at(1), at(2)];
        let inside = places.iter().all(|&p| p > 0) && places.contains(&2);
        let full = if soft { 0.2 + 0.1 * (voxel[0] % 8) as f32 } else { 1.0 };
        if inside { full } else { 0.0 }
    });
    let roi = Roi::new(weight.collect(), &volume).expect("a region");
    (volume, roi)
}

/// Of the product of topology, working grid, mini-batch, storage and kernel the third that is tried from this profile; the
/// next two have the others. What else can be chosen goes round, each with its own period, from a place of the profile's own.
fn ways(profile: &Profile) -> Vec<(String, FitConfig, bool)> {
    let start = profile.config().expect("a profile");
    let place = PROFILES.iter().position(|p| p.name == profile.name).expect("one of the profiles");
    let mut ways = Vec::new();
    let mut tried = 0;
    for topology in TOPOLOGIES {
        for working_grid in [1, 2] {
            for (subset, subset_alone) in SUBSETS {
                for storage in [Storage::Full, Storage::Mixed] {
                    for kernel in &KERNELS {
                        let turn = tried + 53 * place;
                        tried += 1;
                        if !(tried + tried / KERNELS.len() + place).is_multiple_of(3) {
                            continue;
                        }
                        let config = start.clone().with(|c| {
                            c.iterations = 5;
                            c.count.splats = SPLATS;
                            c.topology.name = topology.name.to_owned();
                            c.topology.from = 2;
                            c.topology.every = 2;
                            c.topology.share = 0.3;
                            c.topology.limit = 2.0;
                            c.samples.working_grid = working_grid;
                            c.subset.size = subset;
                            c.subset.alone = subset_alone;
                            c.storage = storage;
                            c.kernel = kernel.kernel;
                            c.init.initialiser = INITIALISERS[turn % INITIALISERS.len()].name.to_owned();
                            c.init.orientation = ORIENTATIONS[turn / 3 % ORIENTATIONS.len()].name.to_owned();
                            c.init.footprint = [0.0, 1.0][turn / 5 % 2];
                            c.init.unit =
                                [ScaleUnit::Voxel, ScaleUnit::Spacing, ScaleUnit::Box][turn / 7 % 3];
                            c.region.background = [Background::Mean, Background::Low][turn / 11 % 2];
                            c.rates.learn_intensity = turn / 13 % 2 == 0;
                            c.rates.clamp_intensity = turn / 17 % 2 == 0;
                            c.rates.learn_opacity = turn / 3 % 2 == 0;
                            c.init.opacity_mask = turn / 5 % 3 == 0;
                            c.rates.sample_every = [3, 0][turn / 21 % 2];
                            c.subset.dense = turn / 2 % 3 == 0;
                            c.region.range = [IntensityRange::Auto, IntensityRange::Roi][turn / 4 % 2];
                            c.region.threshold = [0.0, 0.01, 0.3][turn / 6 % 3];
                            c.loss.mask = MASK_LOSSES[turn / 8 % MASK_LOSSES.len()].name.to_owned();
                            c.loss.intensity =
                                INTENSITY_LOSSES[turn / 9 % INTENSITY_LOSSES.len()].name.to_owned();
                            c.loss.dice_smoothing = [0.0, 1.0][turn / 10 % 2];
                            c.loss.leak_power = 1 + turn as u32 / 3 % 2;
                            c.loss.leak_volume = turn / 12 % 2 == 0;
                            c.loss.scale_weight = [0.0, 0.01][turn / 14 % 2];
                            c.scales.growth = [0.0, 1.5][turn / 15 % 2];
                            c.loss.mask_weight = [0.0, 1.0][turn / 19 % 2];
                            c.loss.leak_weight = [0.0, 0.1][turn / 23 % 2];
                            c.loss.occupancy_weight = [0.004, 0.0][turn / 29 % 2];
                            c.loss.shell_beyond = turn / 31 % 2 == 0;
                            c.samples.form = [FitForm::Field, FitForm::Grid][turn / 18 % 2];
                            c.loss.rim_weight = [0.0, 0.1][turn / 7 % 2];
                            c.loss.occupancy_tolerance = [0.4, 0.0, 0.49][turn / 11 % 3];
                            c.samples.offsets = 1 + 2 * (turn / 2 % 2);
                            c.seed = turn as u64;
                        });
                        let name = format!(
                            "--profile {} --topology {} --working-grid {working_grid} --subset {subset} \
                             --subset-alone {subset_alone} --storage {storage:?} --kernel {} (turn {turn})",
                            profile.name, topology.name, kernel.name,
                        );
                        ways.push((name, config, turn % 4 == 3));
                    }
                }
            }
        }
    }
    ways
}

/// Every way from the profile of that name fits for its iterations, all splats stay sound, and so does the field.
fn every_way_fits(profile: &str) {
    let gpu = Device::boot();
    let regions = [volume_and_region(false), volume_and_region(true)];
    let ways = ways(Profile::named(profile).expect("a profile"));
    let count = ways.len();
    for (name, config, soft) in ways {
        let (volume, roi) = &regions[usize::from(soft)];
        let (volume, roi) = match config.samples.working_grid {
            1 => (volume.clone(), roi.clone()),
            f => (volume.coarsened(f as usize), roi.coarsened(f as usize)),
        };
        let case = Case { volume, roi, config };
        let mut fitter = case.fit(&gpu);
        let splats = fitter.splats().expect("splats");
        if let Some(why) = splats.iter().find_map(defect) {
            panic!("{name}: {why}");
        }
        assert!(!splats.is_empty() && splats.len() <= 2 * SPLATS, "{name}: {} splats", splats.len());
        assert_eq!(fitter.frozen().expect("a count"), 0, "{name}");
        let progress = fitter.progress().expect("progress");
        assert_eq!(progress.iteration, case.config.iterations, "{name}");
        assert!(progress.mse.is_finite() && progress.occupancy_rmse.is_finite(), "{name}: {progress:?}");
    }
    println!("{profile}: {count} combinations");
}

macro_rules! profiles {
    ($($test:ident: $name:literal,)*) => {
        $(#[test]
        fn $test() {
            every_way_fits($name);
        })*

        #[test]
        fn no_profile_is_left_out() {
            assert_eq!(PROFILES.iter().map(|p| p.name).collect::<Vec<_>>(), [$($name),*]);
        }
    };
}

profiles! {
    from_default: "default",
    from_vessels: "vessels",
    from_bones: "bones",
    from_organs: "organs",
    from_mr: "mr",
    from_field: "field",
    from_paper: "paper",
    from_reference: "reference",
}

/// The region does what its name says: it has a voxel at every corner, edge and face of the volume.
#[test]
fn the_region_touches_everything() {
    let (_, roi) = volume_and_region(false);
    for x in [0, SIZE[0] / 2, SIZE[0] - 1] {
        for y in [0, SIZE[1] / 2, SIZE[1] - 1] {
            for z in [0, SIZE[2] / 2, SIZE[2] - 1] {
                let voxel = glam::IVec3::new(x as i32, y as i32, z as i32);
                let is_centre = [x, y, z] == SIZE.map(|n| n / 2);
                assert_eq!(roi.at(voxel) > 0.0, !is_centre, "{voxel}");
            }
        }
    }
}
