//! The mode `decoded`: the splats' field on voxels, marched as those of a CT.

use engine::error::Kind;
use engine::gpu::Gpu;
use engine::image::{Image, psnr};
use engine::render::{
    Appearance, Camera, Classification, ClipPlane, DecodeOptions, Decoded, FieldBudget, Look, Renderer,
    Scene, Settings, VolumeSource, decode, mode,
};
use engine::splat::{Form, Grid, Kernel, Region, Splat, SplatSet, join};
use engine::transfer::{OpacityPoint, Table};
use engine::volume::edges::Edges;
use engine::volume::phantom::Phantom;
use glam::{DAffine3, DMat3, DQuat, DVec3, DVec4, Vec3};
use reference::Footprint;
use reference::eye::{self, Eye};
use reference::raymarch::{self, Cells};
use reference::slab::Look as ReferenceLook;
use reference::splat_bounds::footprint;
use vgs_tests::rendering::{SIZE, camera, look, render, set, settings};
use vgs_tests::{Bound, Device, assert_close, picture};

/// Splats that were fitted on an oblique grid of 2.2 × 1.8 × 3 mm whose face cuts some of them off.
fn fitted(count: usize, kernel: Kernel) -> SplatSet {
    let mut set = set(count, kernel);
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.2, -0.1, 0.4));
    let matrix = turn * DMat3::from_diagonal(DVec3::new(-2.2, 1.8, 3.0));
    let size = [31, 36, 16];
    let middle = DVec3::from_array(size.map(|n| 0.5 * f64::from(n)));
    let origin = set.origin_mm - matrix * middle;
    let world_from_voxel = DAffine3::from_mat3_translation(matrix, origin);
    set.grid = Some(Grid { size, world_from_voxel });
    set
}

/// The same with two objects that overlap in a wide strip.
fn objects(count: usize) -> SplatSet {
    let mut set = fitted(count, Kernel::Compact);
    set.labels = Some(set.splats.iter().map(|s| if s.mean[2] > 0.0 { 4 } else { 7 }).collect());
    set
}

fn at_pitch(pitch: f64) -> DecodeOptions {
    DecodeOptions { pitch, ..DecodeOptions::default() }
}

/// The voxels as the reference implementation has them.
fn reference_voxels(set: &SplatSet, decoded: &Decoded) -> Vec<reference::decoded::Voxel> {
    // With one more on each side, so that all have their neighbours.
    let wide = decoded.size.map(|n| n as usize + 2);
    let scene_from_wide = decoded.scene_from_voxel * DAffine3::from_translation(DVec3::splat(-1.0));
    let local = SplatSet { origin_mm: DVec3::ZERO, ..set.clone() }.to_voxel(&scene_from_wide);
    let numbers = set.labels.clone().unwrap_or_else(|| vec![0; set.splats.len()]);
    let mut there = numbers.clone();
    there.sort_unstable();
    there.dedup();
    let footprints = |number: u8| -> Vec<Footprint> {
        let own = local.iter().zip(&numbers).filter(|(_, n)| **n == number);
        own.map(|(s, _): (&Splat, _)| {
            let splat = reference::Splat::from(s);
            let relative = splat.intensity - f64::from(set.field.background);
            footprint(&reference::Splat { intensity: relative, ..splat }, set.field.kernel)
        })
        .collect()
    };
    let all: Vec<_> = there.iter().map(|&n| footprints(n)).collect();
    let voxels = reference::decoded::decoded(&all, &set.field, wide);
    let inside = |i: usize| {
        let at = [i % wide[0], i / wide[0] % wide[1], i / (wide[0] * wide[1])];
        (0..3).all(|k| (1..wide[k] - 1).contains(&at[k])).then(|| DVec3::from_array(at.map(|v| v as f64)))
    };
    let (last, grid_from_wide) = match set.grid {
        Some(grid) => (
            DVec3::from_array(grid.size.map(|n| f64::from(n) - 1.0)),
            grid.world_from_voxel.inverse() * DAffine3::from_translation(set.origin_mm) * scene_from_wide,
        ),
        None => (DVec3::INFINITY, DAffine3::from_translation(DVec3::splat(1e6))),
    };
    (0..voxels.len())
        .filter_map(|i| {
            let place = grid_from_wide.transform_point3(inside(i)?);
            let beyond = place.cmplt(DVec3::splat(-0.1)).any() || place.cmpgt(last + 0.1).any();
            let occupancy = if beyond { 0.0 } else { voxels[i].occupancy };
            // Beyond the faces V is that at them.
            let step = (place.clamp(DVec3::ZERO, last) - place).round().as_ivec3();
            let at_face = if beyond {
                i as i32 + (step.z * wide[1] as i32 + step.y) * wide[0] as i32 + step.x
            } else {
                i as i32
            };
            let value = voxels[at_face as usize].value;
            Some(reference::decoded::Voxel { occupancy, value, object: usize::from(there[voxels[i].object]) })
        })
        .collect()
}

#[test]
fn voxels_are_those_of_the_reference() {
    let gpu = Device::boot();
    // Of others V is by least squares.
    let samples = |set: SplatSet| SplatSet { form: Form::Grid, ..set };
    for (name, set) in [
        ("compact", samples(fitted(120, Kernel::Compact))),
        ("gaussian", samples(fitted(40, Kernel::Gaussian))),
        ("without a grid", samples(set(60, Kernel::Compact))),
    ] {
        let decoded = decode(&gpu, &set, 1.0).expect("a field");
        let wanted = reference_voxels(&set, &decoded);
        let size = decoded.size;
        let found: Vec<(f64, f64)> = (0..wanted.len() as u32)
            .map(|i| decoded.value([i % size[0], i / size[0] % size[1], i / (size[0] * size[1])]))
            .collect();
        let there = wanted.iter().filter(|v| v.occupancy > 0.0).count();
        println!("{name}: {size:?}, {there} of {} voxels, {} bricks", wanted.len(), decoded.brick_count());
        assert!(there > 200 && there < wanted.len(), "{name}");
        let pairs = |f: &dyn Fn(usize) -> (f64, f64)| (0..wanted.len()).map(f).collect::<Vec<_>>();
        // Whether a voxel at the end of a support is reached may fall either way.
        let occupancies = pairs(&|i| (found[i].1, wanted[i].occupancy));
        assert_close(&format!("{name}: O"), Bound::new(2e-5, 0.0).outliers(1e-3, 1.0), occupancies);
        let values = pairs(&|i| (found[i].0, wanted[i].value));
        assert_close(&format!("{name}: V"), Bound::new(0.05, 1e-5).outliers(2e-3, 1e3), values);
    }
}

/// Returns the set with the region of the voxels of its grid for which `number` returns that of an object.
fn with_region(set: SplatSet, number: impl Fn([usize; 3]) -> Option<u8> + Sync) -> SplatSet {
    let size = set.grid.expect("a grid").size.map(|n| n as usize);
    let at = |i: usize| [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])];
    SplatSet { region: Region::of(size, |i| number(at(i))), form: Form::Grid, ..set }
}

/// A slanted slab with a hole, cut off by two faces of the grid.
fn slab([x, y, z]: [usize; 3]) -> bool {
    let along = x + y / 2 + z;
    (12..30).contains(&along) && !(10..14).contains(&y)
}

/// V of the voxels of a region is that of the splats of one fit, O is the region's, and V beyond it is continued from
/// inside.
#[test]
fn a_region_says_what_is_shown_and_splats_what_is_in_it() {
    let gpu = Device::boot();
    let left = with_region(fitted(80, Kernel::Compact), |at| (slab(at) && at[2] < 9).then_some(0));
    let right = with_region(fitted(50, Kernel::Compact), |at| (slab(at) && at[2] >= 9).then_some(0));
    let both = join(vec![("a".into(), left.clone()), ("b".into(), right.clone())]).expect("two fits");
    for (name, set, fits) in [("one fit", &left, vec![&left]), ("two fits", &both, vec![&left, &right])] {
        let decoded = decode(&gpu, set, 1.0).expect("a field");
        let grid = set.grid.expect("a grid");
        let grid_from_box = grid.world_from_voxel.inverse()
            * DAffine3::from_translation(set.origin_mm)
            * decoded.scene_from_voxel;
        let wanted: Vec<_> =
            fits.iter().map(|fit| reference_voxels(&without_region(fit), &decoded)).collect();
        let regions: Vec<&Region> = fits.iter().filter_map(|fit| fit.region.as_ref()).collect();
        let objects = decoded.objects();
        let ranges: Vec<f64> = set.splats.iter().map(|splat| f64::from(splat.intensity)).collect();
        let least = ranges.iter().copied().fold(f64::INFINITY, f64::min);
        let greatest = ranges.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let [nx, ny, nz] = decoded.size.map(|n| n as usize);
        let (mut values, mut voxels, mut beyond) = (Vec::new(), 0, 0);
        for i in 0..nx * ny * nz {
            let at = [i % nx, i / nx % ny, i / (nx * ny)];
            let place = grid_from_box.transform_point3(DVec3::from_array(at.map(|v| v as f64))).round();
            let (v, o) = decoded.value(at.map(|v| v as u32));
            let of =
                regions.iter().position(|region| region.at(place.to_array().map(|v| v as i64)).is_some());
            assert_eq!(o, f64::from(u8::from(of.is_some())), "{name}: O of {place}");
            let Some(fit) = of else {
                let near = (0..27).any(|k| {
                    let step = DVec3::new(
                        f64::from(k % 3) - 1.0,
                        f64::from(k / 3 % 3) - 1.0,
                        f64::from(k / 9) - 1.0,
                    );
                    let near = (place + step).to_array().map(|v| v as i64);
                    regions.iter().any(|region| region.at(near).is_some())
                });
                // It is a mean of what is inside.
                assert!(!near || (least - 0.1..=greatest + 0.1).contains(&v), "{name}: V of {place} is {v}");
                beyond += usize::from(near);
                continue;
            };
            voxels += 1;
            if let Some(objects) = &objects {
                assert_eq!(usize::from(objects[i]), fit + 1, "{name}: the object of {place}");
            }
            if wanted[fit][i].occupancy > 1e-3 {
                values.push((v, wanted[fit][i].value));
            }
        }
        let inside: usize = regions.iter().map(|region| region.voxel_count()).sum();
        assert_eq!(voxels, inside, "{name}: all voxels are there");
        assert!(values.len() > 300 && beyond > 300, "{name}: {} reached, {beyond} beyond", values.len());
        assert_close(&format!("{name}: V"), Bound::new(0.05, 1e-5).outliers(2e-3, 1e3), values);
    }
}

fn without_region(set: &SplatSet) -> SplatSet {
    SplatSet { region: None, ..set.clone() }
}

/// With smooth edges no voxel changes its side, and V inside is the same.
#[test]
fn smooth_edges_keep_the_sides_of_voxels() {
    let gpu = Device::boot();
    let set = with_region(fitted(80, Kernel::Compact), |at| slab(at).then_some(0));
    let row = mode("decoded").expect("a mode");
    let scene = Scene::new(&gpu, Some(&set), None, &look("CT-Bone", true)).expect("a scene");
    let of = |edges: Edges| {
        let settings = Settings {
            decoding: DecodeOptions { edges, ..DecodeOptions::default() },
            step: 0.25,
            ..settings()
        };
        render(&gpu, row, &scene, &settings, &[camera(&scene)]).remove(0)
    };
    let covered = |image: &Image| image.pixels.iter().map(|pixel| f64::from(pixel[3])).sum::<f64>();
    let [blocks, smooth] = [Edges::Voxel, Edges::Within(0.0)].map(of);
    let share = covered(&smooth) / covered(&blocks);
    let db = psnr(&blocks, &smooth).expect("one size");
    println!("{share:.3} of the opacity of blocks, {db:.1} dB from them");
    assert!((0.9..1.1).contains(&share) && (15.0..60.0).contains(&db), "{share}, {db} dB");
}

/// Between the voxels that they were fitted for splats are wrong, so a finer pitch has nothing to show there.
#[test]
fn fits_for_a_grid_are_decoded_at_its_voxels_at_the_finest() {
    let gpu = Device::boot();
    let field = fitted(80, Kernel::Compact);
    for with in [false, true] {
        let grid = SplatSet { form: Form::Grid, ..field.clone() };
        let set = if with { with_region(grid, |at| slab(at).then_some(0)) } else { grid };
        let [coarse, fine] = [1.0, 0.5].map(|pitch| decode(&gpu, &set, pitch).expect("a field"));
        assert_eq!((coarse.size, coarse.scene_from_voxel), (fine.size, fine.scene_from_voxel));
    }
    let [coarse, fine] = [1.0, 0.5].map(|pitch| decode(&gpu, &field, pitch).expect("a field"));
    assert!((0..3).all(|k| fine.size[k] > 3 * coarse.size[k] / 2), "{:?}, {:?}", coarse.size, fine.size);
}

/// A coarser pitch has the means of the voxels, as the reference implementation takes them, and keeps thin
/// things.
#[test]
fn coarser_voxels_are_means() {
    let gpu = Device::boot();
    for with in [false, true] {
        let grid = SplatSet { form: Form::Grid, ..fitted(80, Kernel::Compact) };
        let set = if with { with_region(grid, |at| slab(at).then_some(0)) } else { grid };
        let [fine, coarse, coarser, as_coarse] =
            [1.0, 2.0, 4.0, 3.0].map(|pitch| decode(&gpu, &set, pitch).expect("a field"));
        assert_eq!((coarser.size, coarser.scene_from_voxel), (as_coarse.size, as_coarse.scene_from_voxel));
        let (mut size, mut voxels) = (fine.size.map(|n| n as usize), all_voxels(&fine));
        for (name, found) in [("2", &coarse), ("4", &coarser)] {
            (size, voxels) = reference::decoded::halved(size, &voxels);
            assert_eq!(found.size.map(|n| n as usize), size, "{name}");
            let got = all_voxels(found);
            let occupancies = got.iter().zip(&voxels).map(|(a, b)| (a.occupancy, b.occupancy));
            assert_close(&format!("{name}: O"), Bound::new(4e-5, 0.0), occupancies.collect::<Vec<_>>());
            let there = got.iter().zip(&voxels).filter(|(_, b)| b.occupancy > 1e-3);
            let values: Vec<_> = there.map(|(a, b)| (a.value, b.value)).collect();
            assert!(values.len() > 100, "{name}: {} voxels", values.len());
            assert_close(&format!("{name}: V"), Bound::new(0.2, 1e-3), values);
        }
        // All of O is there, at its place.
        let whole = |field: &Decoded| {
            let edge = field.scene_from_voxel.matrix3.determinant().abs();
            let [nx, ny, _] = field.size.map(|n| n as usize);
            all_voxels(field).iter().enumerate().fold(DVec4::ZERO, |sum, (i, voxel)| {
                let at = DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
                let place = field.scene_from_voxel.transform_point3(at);
                sum + edge * voxel.occupancy * place.extend(1.0)
            })
        };
        let (wanted, found) = (whole(&fine), whole(&coarser));
        assert!((found.w / wanted.w - 1.0).abs() < 1e-3, "{with}: {found} {wanted}");
        let apart = (found.truncate() / found.w).distance(wanted.truncate() / wanted.w);
        assert!(apart < 0.2, "{with}: {apart} mm");
    }
}

/// All voxels of a box, x fastest, as of one object.
fn all_voxels(field: &Decoded) -> Vec<reference::decoded::Voxel> {
    let [nx, ny, nz] = field.size;
    (0..nx * ny * nz)
        .map(|i| {
            let (value, occupancy) = field.value([i % nx, i / nx % ny, i / (nx * ny)]);
            reference::decoded::Voxel { value, occupancy, object: 0 }
        })
        .collect()
}

/// What is shown of a fit for a binary mask is the mask, and parts of the fit share it.
#[test]
fn a_fit_for_a_binary_mask_shows_the_mask_and_so_do_its_parts() {
    let gpu = Device::boot();
    let phantom = Phantom::new([40, 36, 30], DVec3::new(1.0, 1.0, 1.5), 3);
    let config = engine::fit::FitConfig::default().with(|c| {
        c.count.density = 0.05;
        c.iterations = 12;
    });
    let (volume, roi) = (&phantom.volume(), &phantom.roi().expect("bone and vessels"));
    let whole =
        engine::fit::run(&gpu, volume, roi, &config, |_| std::ops::ControlFlow::Continue(())).expect("a fit");
    let inside = |set: &SplatSet| {
        let decoded = decode(&gpu, set, 1.0).expect("a field");
        let field = decoded.in_voxels_of(volume, set.origin_mm);
        let [nx, ny, _] = volume.size;
        let at = |i: usize| DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
        (0..volume.len()).map(|i| field(at(i)).1).collect::<Vec<_>>()
    };
    let all = inside(&whole);
    let right = all.iter().zip(&roi.weight).filter(|(o, m)| (**o - f64::from(**m)).abs() < 1e-6).count();
    assert_eq!(right, volume.len(), "every voxel");
    let mut places: Vec<f32> = whole.splats.iter().map(|splat| splat.mean[0]).collect();
    places.sort_by(f32::total_cmp);
    let middle = whole.origin_mm.x + f64::from(places[places.len() / 2]);
    let parts = [true, false].map(|left| whole.selected(|_, mean| (mean.x < middle) == left));
    let [left, right] = [&parts[0], &parts[1]].map(inside);
    let shared = (0..volume.len()).filter(|&i| left[i] + right[i] != all[i]).count();
    // What weighs alike in both, or is reached by none, may be in both.
    assert!(shared <= roi.voxel_count() / 200, "{shared} of {} voxels", roi.voxel_count());
    assert!(left.iter().sum::<f64>() > 100.0 && right.iter().sum::<f64>() > 100.0);
}

/// An atlas of bricks is a way to keep voxels, and nothing else.
#[test]
fn an_atlas_is_marched_as_the_same_voxels_in_a_volume() {
    let gpu = Device::boot();
    for (name, set, look, jitter) in [
        ("soft, lit", fitted(120, Kernel::Compact), look("CT-Soft-Tissue", true), true),
        ("bone", fitted(120, Kernel::Gaussian), look("CT-Bone", false), false),
        ("steep", set(90, Kernel::Compact), look("CT-Bones-Steep", true), false),
    ] {
        let decoded = decode(&gpu, &set, 1.0).expect("a field");
        let (volume, roi) = decoded.volume(set.origin_mm).expect("a volume");
        let source = VolumeSource { volume: &volume, roi: Some(&roi) };
        let normal = DVec3::new(0.6, 0.0, 0.8);
        let clip = vec![ClipPlane { normal, offset: normal.dot(set.origin_mm) - 4.0 }];
        let look = Look { clip, ..look };
        let scene = Scene::new(&gpu, Some(&set), Some(&source), &look).expect("a scene");
        let eyes = camera(&scene).eyes(20.0);
        for classification in [Classification::Point, Classification::PreIntegrated] {
            let settings =
                Settings { views: 2, step: 0.5, jitter, classification: Some(classification), ..settings() };
            let [of_volume, of_atlas] = ["volume", "decoded"]
                .map(|name| render(&gpu, mode(name).expect("a mode"), &scene, &settings, &eyes));
            for (a, b) in of_volume.iter().zip(&of_atlas) {
                assert!(a.pixels.iter().filter(|p| p[3] > 0.3).count() > 200, "{name}: something is seen");
                println!("{name}, {classification:?}: {:.1} dB", psnr(a, b).expect("one size"));
                // Places in the atlas round otherwise than places in the volume: an intensity at the border between two
                // entries of the table may take either.
                let numbers = a.pixels.iter().flatten().zip(b.pixels.iter().flatten());
                let pairs = numbers.map(|(a, b)| (f64::from(*b), f64::from(*a)));
                assert_close(name, Bound::new(2e-4, 0.0).outliers(2e-3, 0.02), pairs);
            }
        }
    }
}

/// The picture of the reference voxels, marched by the reference implementation.
fn reference_picture(set: &SplatSet, scene: &Scene, look: &Look, decoded: &Decoded, step: f64) -> Image {
    let voxels = reference_voxels(set, decoded);
    let size = decoded.size.map(|n| n as usize);
    let values: Vec<f32> = voxels.iter().map(|v| v.value as f32).collect();
    let mask: Vec<f32> = voxels.iter().map(|v| v.occupancy as f32).collect();
    let shown = |v: &reference::decoded::Voxel| {
        let shown = look.objects.get(&(v.object as u8)).copied().unwrap_or_default();
        eye::Appearance {
            tint: shown.tint.map_or(DVec4::ZERO, |t| Vec3::from_array(t).as_dvec3().extend(1.0)),
            opacity: if shown.visible { f64::from(shown.opacity) } else { 0.0 },
        }
    };
    let numbers: Vec<u8> = look.functions.keys().copied().collect();
    let function = |v: &reference::decoded::Voxel| {
        numbers.iter().position(|number| usize::from(*number) == v.object).map_or(0, |k| k + 1)
    };
    let medium = raymarch::Medium::new(size, decoded.scene_from_voxel, &values, Some(&mask))
        .with_objects(voxels.iter().map(shown).collect());
    let medium = match numbers.as_slice() {
        [] => medium,
        _ => medium.with_functions(voxels.iter().map(function).collect()),
    };
    let range = scene.splats.as_ref().expect("splats").range;
    let medium = medium.with_own_gradients(look.dark(range));
    let functions: Vec<Table> = look.functions.values().map(|f| Table::new(f, range)).collect();
    let reference_look = ReferenceLook {
        table: &Table::new(&look.transfer, range),
        functions: &functions,
        material: &look.transfer.material,
        light: &look.light,
        dark: look.dark(range),
        planes: &[],
        segments: false,
        gradient_edge: look.transfer.depends_on_gradient().then_some(decoded.edge_mm),
        least_light: 1e-4,
    };
    let eye = Eye::from(&camera(scene).view(scene.origin));
    let spacing = decoded.scene_from_voxel.matrix3.to_cols_array_2d().map(|c| DVec3::from_array(c).length());
    let edge = spacing.into_iter().fold(f64::INFINITY, f64::min);
    let cells =
        Cells { length: edge, parts: (1.0 / step).round() as u32, slack: (range[1] - range[0]) / 32.0 };
    Image {
        size: SIZE.map(|n| n as usize),
        pixels: raymarch::render(&medium, &eye, SIZE, &reference_look, &cells),
    }
}

/// A function that shows edges alone.
fn graded(look: &Look) -> Look {
    let points = [(30.0, 0.0), (200.0, 1.0)].map(|(intensity, opacity)| OpacityPoint { intensity, opacity });
    let transfer = look.transfer.clone().with_gradient_opacity(points.into()).expect("gradient opacities");
    Look { transfer, ..look.clone() }
}

#[test]
fn pictures_are_those_of_the_reference() {
    let gpu = Device::boot();
    let shown = |visible, tint, opacity| Appearance { visible, tint, opacity };
    let samples = |set: SplatSet| SplatSet { form: Form::Grid, ..set };
    let tints = [(4, shown(true, Some([0.1, 0.4, 1.0]), 0.3)), (7, shown(true, Some([1.0, 0.3, 0.1]), 1.0))];
    let hidden = [(4, shown(false, None, 1.0))];
    for (name, set, look) in [
        ("decoded-soft", samples(fitted(150, Kernel::Compact)), look("CT-Soft-Tissue", false)),
        ("decoded-bone-lit", samples(fitted(150, Kernel::Gaussian)), look("CT-Bone", true)),
        (
            "decoded-objects",
            samples(objects(150)),
            Look { objects: tints.into(), ..look("CT-Soft-Tissue", true) },
        ),
        (
            "decoded-functions",
            samples(objects(150)),
            Look { functions: [(7, look("CT-Bone", true).transfer)].into(), ..look("CT-Soft-Tissue", true) },
        ),
        ("decoded-graded", samples(fitted(150, Kernel::Compact)), graded(&look("CT-Soft-Tissue", true))),
        ("decoded-hidden", samples(objects(150)), Look { objects: hidden.into(), ..look("CT-Bone", true) }),
    ] {
        let scene = Scene::new(&gpu, Some(&set), None, &look).expect("a scene");
        let settings = Settings {
            step: 0.5,
            cell: Some(1.0),
            dark: 1e-4,
            classification: Some(Classification::Point),
            ..settings()
        };
        let row = mode("decoded").expect("a mode");
        let found = render(&gpu, row, &scene, &settings, &[camera(&scene)]);
        picture::check(name, &found[0], || {
            let decoded = decode(&gpu, &set, 1.0).expect("a field");
            reference_picture(&set, &scene, &look, &decoded, 0.5)
        });
    }
}

/// Between the voxels V by least squares is nearer to the field than samples are, and so is the picture.
#[test]
fn least_squares_are_nearer_to_the_field_than_samples() {
    let gpu = Device::boot();
    let fitted = set(120, Kernel::Compact);
    let samples = SplatSet { form: Form::Grid, ..fitted.clone() };
    for (name, shade) in [("CT-Soft-Tissue", false), ("CT-Bones-Steep", false), ("CT-Bone", true)] {
        let look = look(name, shade);
        let of = |set: &SplatSet, mode_name: &str, pitch: f64| {
            let scene = Scene::new(&gpu, Some(set), None, &look).expect("a scene");
            let settings = Settings { decoding: at_pitch(pitch), step: 0.5, ..settings() };
            render(&gpu, mode(mode_name).expect("a mode"), &scene, &settings, &[camera(&scene)]).remove(0)
        };
        let exact = of(&fitted, "exact", 1.0);
        let db = |set: &SplatSet, pitch| psnr(&exact, &of(set, "decoded", pitch)).expect("one size");
        for pitch in [1.0, 0.5] {
            let (nearest, sampled) = (db(&fitted, pitch), db(&samples, pitch));
            println!("{name}, pitch {pitch}: {nearest:.1} dB, of samples {sampled:.1}");
            assert!(nearest > sampled, "{name}: {nearest} and {sampled}");
        }
    }
}

/// The finer the voxels, the nearer is the picture to the field between them.
#[test]
fn a_finer_pitch_is_nearer_to_the_field() {
    let gpu = Device::boot();
    // Without a grid, whose faces would cut some of it off.
    let set = set(120, Kernel::Compact);
    let scene = Scene::new(&gpu, Some(&set), None, &look("CT-Soft-Tissue", false)).expect("a scene");
    let of = |name: &str, pitch: f64, step: f64| {
        let settings = Settings { decoding: at_pitch(pitch), step, ..settings() };
        render(&gpu, mode(name).expect("a mode"), &scene, &settings, &[camera(&scene)]).remove(0)
    };
    let exact = of("exact", 1.0, 1.0);
    let found = [2.0, 1.0, 0.5, 0.25]
        .map(|pitch| psnr(&exact, &of("decoded", pitch, 0.5)).expect("pictures of one size"));
    println!("{found:.1?} dB");
    assert!(found.windows(2).all(|p| p[0] < p[1]) && found[3] > 35.0, "{found:?}");
}

/// Gradients are over the edge of a voxel of the grid, however fine the decoded voxels are.
#[test]
fn gradients_do_not_depend_on_the_pitch() {
    let gpu = Device::boot();
    let set = fitted(150, Kernel::Compact);
    let opacity = |look: &Look, pitch: f64| {
        let scene = Scene::new(&gpu, Some(&set), None, look).expect("a scene");
        let settings = Settings { decoding: at_pitch(pitch), step: 0.25 / pitch, ..settings() };
        let image =
            render(&gpu, mode("decoded").expect("a mode"), &scene, &settings, &[camera(&scene)]).remove(0);
        image.pixels.iter().map(|p| f64::from(p[3])).sum::<f64>()
    };
    let plain = look("CT-Soft-Tissue", false);
    let shares = [0.5, 0.25].map(|pitch| opacity(&graded(&plain), pitch) / opacity(&plain, pitch));
    println!("{shares:?} of the opacity stays");
    assert!(0.1 < shares[0] && shares[0] < 0.95 && (shares[0] / shares[1] - 1.0).abs() < 0.05, "{shares:?}");
}

/// A field is decoded once: looks change, modes come and go, and its bytes are accounted for.
#[test]
fn it_is_decoded_once() {
    let gpu = Device::boot();
    let set = fitted(60, Kernel::Compact);
    let row = mode("decoded").expect("a mode");
    let bytes = |gpu: &Gpu| gpu.memory_by_purpose().get("decoded field").copied().unwrap_or(0);
    let mut scene = Scene::new(&gpu, Some(&set), None, &look("CT-Bone", false)).expect("a scene");
    let is_decoded =
        |scene: &Scene| scene.splats.as_ref().expect("splats").has_decoded(DecodeOptions::default());
    assert!(!is_decoded(&scene) && bytes(&gpu) == 0, "not before it is asked for");
    let first = render(&gpu, row, &scene, &settings(), &[camera(&scene)]).remove(0);
    assert!(is_decoded(&scene));
    let before = bytes(&gpu);
    assert!(before > 4 * 729, "{before} bytes");
    for name in ["CT-Soft-Tissue", "CT-Skin", "CT-Bone"] {
        scene.set_look(&look(name, false)).expect("a look");
        let found = render(&gpu, row, &scene, &settings(), &[camera(&scene)]).remove(0);
        let fresh = Scene::new(&gpu, Some(&set), None, &look(name, false)).expect("a scene");
        let wanted = render(&gpu, row, &fresh, &settings(), &[camera(&fresh)]).remove(0);
        assert_eq!(found, wanted, "{name}");
    }
    assert_eq!(render(&gpu, row, &scene, &settings(), &[camera(&scene)]).remove(0), first);
    drop(scene);
    gpu.wait_idle().expect("waiting");
    assert_eq!(bytes(&gpu), 0, "it goes with its scene");
}

/// Splats that reach very far are decoded more coarsely, and a pitch that is none is refused.
#[test]
fn what_is_too_much_is_coarser_and_what_is_no_pitch_is_refused() {
    let gpu = Device::boot();
    // Samples alone: these are nine million voxels.
    let mut wide = SplatSet { form: Form::Grid, ..set(60, Kernel::Compact) };
    wide.splats[3].log_scale = [7.5; 3];
    let decoded = decode(&gpu, &wide, 1.0).expect("a field");
    assert!(decoded.brick_count() <= 1 << 17, "{}", decoded.brick_count());
    let scene = Scene::new(&gpu, Some(&wide), None, &look("CT-Bone", false)).expect("a scene");
    let row = mode("decoded").expect("a mode");
    for pitch in [0.0, 0.1, 17.0, f64::NAN] {
        let error = Renderer::new(&gpu, row, &scene, &Settings { decoding: at_pitch(pitch), ..settings() })
            .err()
            .expect("an error");
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-RENDER-024"), "{pitch}");
    }
}

/// The same splats on a grid four times as fine, so that the bricks are sampled in several slabs.
fn on_a_fine_grid(set: SplatSet) -> SplatSet {
    let grid = set.grid.expect("a grid");
    let world_from_voxel = grid.world_from_voxel * DAffine3::from_scale(DVec3::splat(0.25));
    let fine = Grid { size: grid.size.map(|n| 4 * n - 3), world_from_voxel };
    SplatSet { grid: Some(fine), form: Form::Grid, ..set }
}

/// Many bricks are sampled slab by slab, to the same voxels and objects as all at once.
#[test]
fn slabs_of_bricks_are_one_field() {
    let gpu = Device::boot();
    let set = on_a_fine_grid(objects(60));
    let plain = SplatSet { form: set.form, ..objects(60) };
    let [fine, coarse] = [&set, &plain].map(|set| decode(&gpu, set, 1.0).expect("a field"));
    let counts = [&fine, &coarse].map(Decoded::brick_count);
    assert!(counts[0] > 2048 && counts[1] < 2048, "several slabs and one: {counts:?}");
    let fine_from_coarse = fine.scene_from_voxel.inverse() * coarse.scene_from_voxel;
    let [nx, ny, nz] = coarse.size;
    let (mut values, mut occupancies) = (Vec::new(), Vec::new());
    for i in 0..nx * ny * nz {
        let at = [i % nx, i / nx % ny, i / (nx * ny)];
        let place = fine_from_coarse.transform_point3(DVec3::from_array(at.map(f64::from)));
        let there =
            place.cmpge(DVec3::ZERO).all() && place.cmplt(DVec3::from_array(fine.size.map(f64::from))).all();
        let (v, o) = coarse.value(at);
        if there && o > 0.01 {
            let found = fine.value(place.round().as_uvec3().to_array());
            values.push((found.0, v));
            occupancies.push((found.1, o));
        }
    }
    assert!(values.len() > 1000, "{}", values.len());
    assert_close("V", Bound::new(0.1, 1e-5), values);
    assert_close("O", Bound::new(1e-4, 0.0), occupancies);

    let tint = |tint: [f32; 3]| Appearance { tint: Some(tint), ..Appearance::default() };
    let look = Look {
        objects: [(4, tint([1.0, 0.2, 0.1])), (7, tint([0.1, 0.4, 1.0]))].into(),
        ..look("CT-Soft-Tissue", false)
    };
    let scene = Scene::new(&gpu, Some(&set), None, &look).expect("a scene");
    let row = mode("decoded").expect("a mode");
    let [found, wanted] = [1.0, 2.0].map(|pitch| {
        render(&gpu, row, &scene, &Settings { decoding: at_pitch(pitch), ..settings() }, &[camera(&scene)])
            .remove(0)
    });
    let db = psnr(&wanted, &found).expect("pictures of one size");
    println!("tinted, in slabs against half as fine in one: {db:.1} dB");
    assert!(db > 30.0, "objects keep their places: {db:.1} dB");
}

/// A decoding tells how far it is, and ends when the scene that wants it is gone.
#[test]
fn a_decoding_tells_its_progress_and_ends_with_its_scene() {
    let gpu = Device::boot();
    let set = on_a_fine_grid(fitted(60, Kernel::Compact));
    let begin = |parts: &mut Vec<f32>, is_gone: bool| {
        let scene = Scene::new(&gpu, Some(&set), None, &look("CT-Bone", false)).expect("a scene");
        let job =
            scene.splats.as_ref().expect("splats").decoding(&gpu, DecodeOptions::default()).expect("a job");
        let scene = (!is_gone).then_some(scene);
        job(&mut |part| parts.push(part)).expect("decoded");
        scene
            .is_some_and(|scene| scene.splats.as_ref().expect("splats").has_decoded(DecodeOptions::default()))
    };
    let (mut all, mut gone) = (Vec::new(), Vec::new());
    assert!(begin(&mut all, false));
    assert!(all.len() > 1 && all[0] == 0.0 && all.is_sorted() && all.iter().all(|p| *p < 1.0), "{all:?}");
    assert!(!begin(&mut gone, true) && gone == [0.0], "not a slab for nobody: {gone:?}");
}

/// With a quarter of the memory that it takes, a field has its near bricks whole and is coarser elsewhere, never with a hole;
/// with enough of it pictures have the same bits.
#[test]
fn a_budget_of_memory_keeps_what_is_near_whole() {
    let gpu = Device::boot();
    let set = on_a_fine_grid(objects(60));
    let tint = |tint: [f32; 3]| Appearance { tint: Some(tint), ..Appearance::default() };
    let tints = [(4, tint([1.0, 0.2, 0.1])), (7, tint([0.1, 0.4, 1.0]))];
    let hidden = [(4, Appearance { visible: false, ..Appearance::default() })];
    let row = mode("decoded").expect("a mode");
    for (name, look) in [
        ("soft", look("CT-Soft-Tissue", false)),
        ("lit", look("CT-Bone", true)),
        ("objects", Look { objects: tints.into(), ..look("CT-Soft-Tissue", true) }),
        ("hidden", Look { objects: hidden.into(), ..look("CT-Bone", true) }),
        (
            "functions",
            Look { functions: [(7, look("CT-Bone", true).transfer)].into(), ..look("CT-Soft-Tissue", true) },
        ),
        ("graded", graded(&look("CT-Soft-Tissue", true))),
    ] {
        let scene = Scene::new(&gpu, Some(&set), None, &look).expect("a scene");
        let whole = camera(&scene);
        // Half as far, to see what is near larger.
        let middle = whole.eye + whole.forward() * (scene.origin - whole.eye).dot(whole.forward());
        let near = Camera { eye: whole.eye.lerp(middle, 0.5), ..whole };
        let shown = |budget: Option<FieldBudget>, camera: Camera| {
            let decoding = DecodeOptions { budget, ..DecodeOptions::default() };
            let picture =
                render(&gpu, row, &scene, &Settings { decoding, ..settings() }, &[camera]).remove(0);
            let purposes = gpu.memory_by_purpose();
            let taken =
                ["decoded field", "gradients"].map(|purpose| purposes.get(purpose).copied().unwrap_or(0));
            (picture, taken.iter().sum::<u64>())
        };
        let (wanted, takes) = shown(None, near);
        let (same, _) = shown(Some(FieldBudget { bytes: 4 * takes, camera: Some(near) }), near);
        let bits = |image: &Image| image.pixels.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert!(bits(&same) == bits(&wanted), "{name}: with enough memory");
        let budget = FieldBudget { bytes: takes / 4, camera: Some(near) };
        let (found, took) = shown(Some(budget), near);
        // Drivers round the rows of small images up.
        assert!(took <= takes / 4 * 6 / 5 && took > takes / 16, "{name}: {took} bytes of {takes}");
        let holes = wanted.pixels.iter().zip(&found.pixels).filter(|(w, f)| w[3] > 0.5 && f[3] < 0.5 * w[3]);
        assert_eq!(holes.count(), 0, "{name}: no hole");
        let db = psnr(&wanted, &found).expect("one size");
        println!("{name}: {took} bytes of {takes}: {db:.1} dB");
        assert!(db > 28.0, "{name}: {db} dB");
        // Seen from another side, others are near; the field need not be decoded again.
        let behind = near.turned(middle, near.up, std::f64::consts::PI);
        let (wanted, _) = shown(None, behind);
        let splats = scene.splats.as_ref().expect("splats");
        let from = |camera: Camera| {
            let options = DecodeOptions {
                budget: Some(FieldBudget { camera: Some(camera), ..budget }),
                ..DecodeOptions::default()
            };
            splats.decoding(&gpu, options).expect("a job")(&mut |_| ()).expect("decoded");
            psnr(&wanted, &shown(options.budget, behind).0).expect("one size")
        };
        let [old, new] = [near, behind].map(from);
        println!("{name}, from behind: {old:.1} dB by what was near, {new:.1} dB by what is");
        assert!(new != old && new > 28.0, "{name}: {old} dB, then {new} dB");
    }
}
