//! The slab mode: what a look can show, projection, pairs of splats and tiles, and the sum along rays.

use std::collections::{BTreeMap, HashMap};

use engine::gpu::{Gpu, Kernel};
use engine::passes::activity::ActivitySources;
use engine::passes::tiles::TILE;
use engine::passes::{Activity, Ranking, SplatRows, TileBinner};
use engine::render::{Appearance, Camera, Look, LookBuffers};
use engine::splat::kernel::KERNELS;
use engine::splat::{self, Field, Packed, Splat};
use engine::transfer::{Light, Material, Table, preset};
use glam::{DVec3, DVec4, Vec3};
use rand::RngExt;
use reference::activity::limit_active as limited;
use reference::eye::{self, Eye};
use reference::hidden as hidden_reference;
use reference::slab;
use shaders_glsl::types::{Projected, SlabParams, TileGrid, View};
use vgs_tests::rendering::SIDE_LIGHT;
use vgs_tests::scene::{random, splat};
use vgs_tests::{Bound, Device, assert_close};

use super::{hidden, run};

/// Splats in mm about the origin, and two eyes that see them: one asymmetric from outside, one wide from among them.
struct Stage {
    splats: Vec<Splat>,
    field: Field,
    views: Vec<View>,
    grid: TileGrid,
    /// What no eye sees of the pictures; empty where nobody asks.
    patches: Vec<u32>,
}

/// How the objects of a stage are shown; splat i belongs to object i % 4.
fn appearances() -> BTreeMap<u8, Appearance> {
    let plain = Appearance::default();
    BTreeMap::from([
        (0, Appearance { tint: Some([0.9, 0.2, 0.1]), ..plain }),
        (1, Appearance { opacity: 0.3, ..plain }),
        (3, Appearance { tint: Some([0.0, 0.5, 1.0]), opacity: 0.0, ..plain }),
    ])
}

/// The same for the reference implementations.
fn appearance(splat: usize) -> eye::Appearance {
    let shown = appearances().get(&(splat as u8 % 4)).copied().unwrap_or_default();
    let tint = shown.tint.map_or(DVec4::ZERO, |t| Vec3::from_array(t).as_dvec3().extend(1.0));
    eye::Appearance { tint, opacity: f64::from(shown.opacity) }
}

const SIZE: [u32; 2] = [52, 40];

fn stage(seed: u64, kernel: splat::Kernel, count: usize) -> Stage {
    let mut rng = random(seed);
    let splats = (0..count)
        .map(|_| {
            let mut s = splat(&mut rng, Vec3::splat(60.0));
            s.mean = s.mean.map(|v| v - 30.0);
            s.log_scale = s.log_scale.map(|v| v + 0.7);
            s.intensity = rng.random_range(-200.0f32..1200.0);
            s
        })
        .collect();
    let outside =
        Camera::from_side("anterior-left-superior", DVec3::ZERO, 40.0, 40.0, 1.3).expect("a camera");
    let inside =
        Camera::from_side("posterior", DVec3::new(2.0, -30.0, 1.0), 20.0, 150.0, 1.3).expect("a camera");
    let mut views: Vec<View> = [outside, inside].iter().map(|c| c.view(DVec3::ZERO)).collect();
    views[0].tangents[0] *= 0.6;
    views[0].tangents[3] *= 1.2;
    let grid = TileGrid {
        size: SIZE,
        tiles: SIZE.map(|n| n.div_ceil(TILE)),
        centre: [1.0, -2.0, 0.5],
        radius: 75.0,
        spacing: 1.7,
        planes: 8,
        blocks: 12,
        splat_count: count as u32,
        capacity: 0,
    };
    // A kernel of unit integral has small weights.
    let occupancy_w0 = if kernel.row().unit_integral { 1e-4 } else { 0.05 };
    Stage {
        splats,
        field: Field { kernel, background: 80.0, occupancy_w0, epsilon: 1e-5 },
        views,
        grid,
        patches: Vec::new(),
    }
}

impl Stage {
    fn eyes(&self) -> Vec<Eye> {
        self.views.iter().map(Into::into).collect()
    }

    fn seen(&self, eye: &Eye) -> Vec<Option<slab::Seen>> {
        let background = f64::from(self.field.background);
        self.splats.iter().map(|s| slab::seen(&s.into(), eye, self.field.kernel, background)).collect()
    }

    /// Parts of a tile that no eye sees.
    fn hidden_parts(&self, view: usize, tile: [u32; 2]) -> u32 {
        if self.patches.is_empty() {
            return 0;
        }
        hidden_reference::hidden_parts(&hidden::of(&self.patches, view), tile, SIZE)
    }

    /// Planes as the kernels place them.
    fn planes(&self, eye: &Eye) -> slab::Planes {
        let centre = DVec3::from_array(self.grid.centre.map(f64::from));
        let first = (eye.seen(centre).z - f64::from(self.grid.radius)).max(1.0);
        let count = self.grid.planes * self.grid.blocks;
        slab::Planes { first, spacing: f64::from(self.grid.spacing), count }
    }
}

/// The passes up to the sorted pairs, all splats active.
fn binned(gpu: &Gpu, stage: &Stage) -> (TileBinner, TileGrid) {
    bin(gpu, stage, &SplatRows::full(gpu, &stage.splats).unwrap())
}

/// The same with rows of the caller's choice.
fn bin(gpu: &Gpu, stage: &Stage, splats: &SplatRows) -> (TileBinner, TileGrid) {
    let count = stage.splats.len();
    let views = hidden::views(gpu, &stage.views, &stage.patches);
    let hidden = !stage.patches.is_empty();
    let active = gpu.upload("active", "test", &(0..count as u32).collect::<Vec<_>>()).unwrap();
    let counts = gpu.upload("count", "test", &[count as u32]).unwrap();
    let mut bins = TileBinner::new(
        gpu,
        stage.field.kernel,
        splats.packed,
        &stage.grid,
        stage.views.len() as u32,
        count,
        hidden,
    )
    .unwrap();
    loop {
        let grid = TileGrid { capacity: bins.capacity() as u32, ..stage.grid };
        run(gpu, |r| bins.record(r, &grid, stage.field.background, &views, splats, (&active, &counts)));
        let needed = bins.needed().unwrap();
        if needed <= bins.capacity() {
            return (bins, grid);
        }
        bins.grow(needed).unwrap();
    }
}

/// q of a projected splat at depth z on a ray, by the formula of `projected.glsl`.
fn squared_distance(p: &Projected, ray: DVec3, z: f64) -> f64 {
    let [cx, cy] = p.centre.map(f64::from);
    let [r00, r01, r02] = p.along.map(f64::from);
    let [r11, r12, r22] = p.across.map(f64::from);
    let (x, y, s) = (ray.x - cx, ray.y - cy, 1.0 - f64::from(p.depth) / z);
    z * z * ((r00 * s + r01 * x + r02 * y).powi(2) + (r11 * x + r12 * y).powi(2) + (r22 * y).powi(2))
}

pub fn project_splats() {
    let gpu = Device::boot();
    for row in &KERNELS {
        let mut stage = stage(3 + u64::from(row.kernel.id()), row.kernel, 200);
        // The Gaussian from packed rows: its reference sees what they unpack to.
        let packed = (row.kernel == splat::Kernel::Gaussian).then(|| Packed::new(&stage.splats, None));
        let (bins, _) = match &packed {
            Some(packed) => {
                stage.splats = packed.unpack_all();
                bin(&gpu, &stage, &SplatRows::packed(&gpu, packed).unwrap())
            }
            None => binned(&gpu, &stage),
        };
        let got = bins.projected.read().unwrap();
        let mut rng = random(99);
        let (mut amplitudes, mut distances, mut reaches) = (Vec::new(), Vec::new(), Vec::new());
        for (v, eye) in stage.eyes().iter().enumerate() {
            for (i, seen) in stage.seen(eye).iter().enumerate() {
                let p = &got[v * stage.splats.len() + i];
                let Some(seen) = seen else {
                    assert_eq!(*p, Projected::default(), "a splat behind the eye has no row");
                    continue;
                };
                amplitudes.push((f64::from(p.amplitude), seen.amplitude));
                reaches.push((f64::from(p.reach), seen.extent.z));
                for _ in 0..4 {
                    let aside = DVec3::from_array(std::array::from_fn(|k| {
                        rng.random_range(-1.0..1.0) * seen.extent[k]
                    }));
                    let x = seen.mean + aside;
                    if x.z > slab::NEAREST {
                        let wanted = (seen.whitening * (x - seen.mean)).length_squared();
                        distances.push((squared_distance(p, x / x.z, x.z), wanted));
                    }
                }
            }
        }
        assert!(distances.len() > 1000, "{}", distances.len());
        assert_close("project_splats: amplitude", Bound::new(0.0, 2e-6), amplitudes);
        assert_close("project_splats: reach", Bound::new(0.0, 2e-6), reaches);
        // Wide angles and near splats: the centre's tangent then has few digits left for what is beside it.
        assert_close("project_splats: q", Bound::new(2e-4, 2e-4).outliers(0.02, 0.05), distances);
    }
}

pub fn emit_tile_pairs() {
    let gpu = Device::boot();
    for (row, hidden) in KERNELS.iter().flat_map(|row| [(row, false), (row, true)]) {
        let mut stage = stage(40 + u64::from(row.kernel.id()), row.kernel, 120);
        if hidden {
            stage.patches = hidden::lens_and_inset();
        }
        let (bins, grid) = binned(&gpu, &stage);
        let [tx, ty] = grid.tiles;
        let starts = bins.starts().read().unwrap();
        let pairs = bins.pairs().read_range(0, *starts.last().unwrap() as usize).unwrap();
        // Every list holds its splats in order, once.
        let mut parts: HashMap<(u32, usize), u32> = HashMap::new();
        for list in 0..starts.len() - 1 {
            let rows = &pairs[starts[list] as usize..starts[list + 1] as usize];
            assert!(rows.windows(2).all(|p| p[0] & 0xFF_FFFF < p[1] & 0xFF_FFFF), "list {list}");
            for &pair in rows {
                assert_ne!(pair >> 24, 0, "a pair reaches some part");
                let tile = list as u32 / grid.blocks;
                let unseen = stage.hidden_parts((tile / (tx * ty)) as usize, [tile % tx, tile / tx % ty]);
                assert_eq!(pair >> 24 & unseen, 0, "a pair reaches only parts that are seen");
                parts.insert((pair & 0xFF_FFFF, list), pair >> 24);
            }
        }
        // All that a ray meets is there.
        let mut met: HashMap<(u32, usize), u32> = HashMap::new();
        for (v, eye) in stage.eyes().iter().enumerate() {
            let planes = stage.planes(eye);
            let seen = stage.seen(eye);
            for y in 0..SIZE[1] {
                for x in 0..SIZE[0] {
                    let ray = eye.ray([f64::from(x) + 0.5, f64::from(y) + 0.5], SIZE);
                    let tile = (v as u32 * ty + y / TILE) * tx + x / TILE;
                    let part = (x % TILE) / 4 + (y % TILE) / 8 * 4;
                    if stage.hidden_parts(v, [x / TILE, y / TILE]) >> part & 1 == 1 {
                        continue;
                    }
                    for (i, splat) in seen.iter().enumerate() {
                        let Some(splat) = splat else { continue };
                        let reach = splat.extent.z / planes.spacing;
                        let middle = (splat.mean.z - planes.first) / planes.spacing;
                        let from = (middle - reach - 1.0).max(0.0) as u32;
                        let to = ((middle + reach + 1.0).max(0.0) as u32).min(planes.count - 1);
                        for k in from..=to {
                            let z = planes.first + (f64::from(k) + 0.5) * planes.spacing;
                            let u = splat.whitening * (ray * z - splat.mean);
                            if u.length_squared() < row.support_q * (1.0 - 1e-4) {
                                let list = (tile * grid.blocks + k / grid.planes) as usize;
                                let at = (v * stage.splats.len() + i) as u32;
                                *met.entry((at, list)).or_default() |= 1 << part;
                            }
                        }
                    }
                }
            }
        }
        for (pair, wanted) in &met {
            let got = parts.get(pair).copied().unwrap_or_default();
            assert_eq!(got & wanted, *wanted, "{}: splat {} of list {}", row.name, pair.0, pair.1);
        }
        // And little more: outlines and depths are bounded apart from each other.
        let excess = parts.len() as f64 / met.len() as f64;
        println!("{}: {} pairs, {} met: {excess:.2}", row.name, parts.len(), met.len());
        assert!(excess < 2.0, "{excess}");
    }
}

pub fn slab() {
    let gpu = Device::boot();
    let mut transfer = preset("CT-Bone").unwrap().over([-1000.0, 2000.0]);
    let cut = [[0.6f32, 0.0, 0.8, 12.0], [0.0, -1.0, 0.0, 25.0]];
    let plain = [(false, false, false), (true, false, false), (false, true, false)];
    let varied = plain.map(|(segments, shade, _)| (segments, shade, true));
    for (row, (segments, shade, objects)) in KERNELS.iter().cycle().zip(plain.into_iter().chain(varied)) {
        for shape in [8u32, 64] {
            let mut stage = stage(70 + u64::from(row.kernel.id()), row.kernel, 60);
            let hidden = (shape == 8) == segments;
            if hidden {
                stage.patches = hidden::lens_and_inset();
            }
            transfer.material =
                Material { shade, ambient: 0.2, diffuse: 0.7, specular: 0.3, power: 12.0, occlusion: 0.0 };
            let light = if shape == 64 { SIDE_LIGHT } else { Light::default() };
            let look = Look { objects: appearances(), light, ..Look::new(transfer.clone()) };
            let table = Table::new(&look.transfer, [-300.0, 1300.0]);
            let mut buffers = LookBuffers::new(&gpu, &look, [-300.0, 1300.0], DVec3::ZERO).unwrap();
            let mut row_on_device = buffers.rows.read().unwrap()[0];
            row_on_device.plane_count = 2;
            row_on_device.planes[..2].copy_from_slice(&cut);
            buffers.rows.write_range(0, &[row_on_device]).unwrap();
            let (bins, grid) = binned(&gpu, &stage);
            let constants = [
                row.kernel.id(),
                shape,
                u32::from(segments),
                u32::from(shade),
                1,
                u32::from(objects),
                u32::from(hidden),
            ];
            let kernel = Kernel::new(&gpu, &shaders_glsl::SLAB, &constants).unwrap();
            let mut target = engine::render::Target::new(&gpu, SIZE, 2, true, true).unwrap();
            let views = gpu.upload("views", "test", &stage.views).unwrap();
            let numbers: Vec<u32> = (0..stage.splats.len() as u32).map(|i| i % 4).collect();
            let numbers = gpu.upload("objects", "test", &numbers).unwrap();
            let params = SlabParams {
                first_row: 0,
                grid,
                background: stage.field.background,
                epsilon: stage.field.epsilon,
                occupancy_w0: stage.field.occupancy_w0,
                dark: 1e-3,
            };
            run(&gpu, |r| {
                r.pass(&kernel)
                    .read("views", &views)
                    .read("look_rows", &buffers.rows)
                    .read("look_points", &buffers.points)
                    .read("look_integrals", &buffers.integrals)
                    .read("starts", bins.starts())
                    .read("pairs", bins.pairs())
                    .read("projected", &bins.projected)
                    .write_image("colour_image", &mut target.colour)
                    .write_image("depth_image", &mut target.depth)
                    .read("active_objects", &numbers)
                    .read("appearances", &buffers.appearances)
                    .read("hidden_parts", &bins.hidden_parts)
                    .push(&params)
                    .dispatch_3d([grid.tiles[0] * if shape == 8 { 8 } else { 4 }, grid.tiles[1], 2]);
            });
            let reference_look = slab::Look {
                table: &table,
                functions: &[],
                material: &look.transfer.material,
                light: &look.light,
                dark: f64::from(row_on_device.dark),
                planes: &cut.map(|p| p.map(f64::from)),
                segments,
                gradient_edge: None,
                least_light: 1e-3,
            };
            let depths: Vec<f32> = target.depth.read().unwrap();
            let (mut colours, mut depth_pairs, mut opaque, mut unseen) = (Vec::new(), Vec::new(), 0, 0);
            for (v, eye) in stage.eyes().iter().enumerate() {
                let got = target.read_colour(v as u32).unwrap();
                let shown = |(i, splat): (usize, Option<slab::Seen>)| match objects {
                    true => splat.map(|s| slab::Seen { appearance: appearance(i), ..s }),
                    false => splat,
                };
                let seen: Vec<_> = stage.seen(eye).into_iter().enumerate().filter_map(shown).collect();
                for (i, pixel) in got.iter().enumerate() {
                    let [x, y] = [i as u32 % SIZE[0], i as u32 / SIZE[0]];
                    let part = (x % TILE) / 4 + (y % TILE) / 8 * 4;
                    if stage.hidden_parts(v, [x / TILE, y / TILE]) >> part & 1 == 1 {
                        assert_eq!((*pixel, depths[v * got.len() + i]), ([0.0; 4], 0.0), "hidden: {x}, {y}");
                        unseen += 1;
                        continue;
                    }
                    let ray = eye.ray([f64::from(x) + 0.5, f64::from(y) + 0.5], SIZE);
                    let wanted =
                        slab::ray(&seen, &stage.field, eye, ray, &stage.planes(eye), &reference_look);
                    // Two of four objects are faint.
                    opaque += usize::from(wanted.clear < if objects { 0.8 } else { 0.5 });
                    colours.extend(pixel.iter().zip(wanted.pixel()).map(|(&g, w)| (f64::from(g), w)));
                    depth_pairs.push((f64::from(depths[v * got.len() + i]), wanted.depth));
                }
            }
            assert!(opaque > 200, "the scene is to be seen: {opaque}");
            assert_eq!(unseen > 100, hidden, "{unseen} pixels are hidden");
            // An intensity at the border between two entries of the table may take either; a plane at a clip plane may
            // be on either side of it.
            let label = format!(
                "slab: {} segments {segments} shade {shade} objects {objects} shape {shape}",
                row.name
            );
            assert_close(&label, Bound::new(1.5e-3, 0.0).outliers(0.01, 0.1), colours);
            assert_close(
                &format!("{label}, depth"),
                Bound::new(0.15, 1e-3).outliers(0.01, 20.0),
                depth_pairs,
            );
        }
    }
}

pub fn mark_active() {
    let gpu = Device::boot();
    let hidden = Appearance { visible: false, ..Appearance::default() };
    let look = Look {
        objects: BTreeMap::from([
            (3, hidden),
            (7, Appearance { opacity: 0.0, ..Appearance::default() }),
            (200, hidden),
        ]),
        ..Look::new(preset("CT-Skin").unwrap().over([-1000.0, 2000.0]))
    };
    let range = [-1000.0, 2000.0];
    let buffers = LookBuffers::new(&gpu, &look, range, DVec3::ZERO).unwrap();
    let [low, high] = look.transfer.visible().unwrap();
    let mut rng = random(5);
    let count = 1000;
    let intervals: Vec<[f32; 2]> = (0..count)
        .map(|_| {
            let a = rng.random_range(-1000.0f32..1500.0);
            [a, a + rng.random_range(0.0f32..400.0)]
        })
        .collect();
    // On every 50th no transfer function acts.
    let free = |i: usize| i.is_multiple_of(50);
    let intervals: Vec<_> =
        intervals.into_iter().enumerate().map(|(i, v)| if free(i) { [1.0, 0.0] } else { v }).collect();
    let labels: Vec<u32> = (0..count).map(|i| [0, 3, 7, 200][i % 4]).collect();
    let sources = ActivitySources {
        look: &buffers.rows,
        visible: &buffers.visible,
        appearances: &buffers.appearances,
        intervals: &gpu.upload("intervals", "test", &intervals).unwrap(),
        objects: &gpu.upload("objects", "test", &labels).unwrap(),
    };
    let mut activity = Activity::new(&gpu, count).unwrap();
    let mut list = |budget: Option<(&mut Ranking, usize)>| {
        run(&gpu, |r| activity.record(r, &sources, budget));
        let found = activity.count.read().unwrap()[0] as usize;
        activity.active.read_range(0, found).unwrap()
    };
    let active = list(None);
    let found = active.len();
    assert!(active.windows(2).all(|p| p[0] < p[1]), "in order");
    for i in 0..count {
        let there = active.binary_search(&(i as u32)).is_ok();
        let [from, to] = intervals[i].map(f64::from);
        let shown = ![3, 200].contains(&labels[i]);
        // An entry of the table more on each side.
        if free(i) {
            assert_eq!(there, shown, "splat {i}, whatever the transfer function");
            continue;
        }
        if shown && to >= low && from <= high {
            assert!(there, "splat {i} from {from} to {to} can be seen");
        }
        if !shown || to < low - 3.0 || from > high + 3.0 {
            assert!(!there, "splat {i} from {from} to {to} cannot be seen");
        }
    }
    assert!((30..900).contains(&found), "{found}");

    // With a budget, the first ones of an order; in the order of the splats all the same.
    let mut order: Vec<u32> = (0..count as u32).collect();
    order.sort_by_key(|&i| i.wrapping_mul(2_654_435_761));
    let mut ranking = Ranking::new(&gpu, &order).unwrap();
    let flags: Vec<bool> = (0..count as u32).map(|i| active.binary_search(&i).is_ok()).collect();
    for budget in [0, 1, 17, found - 1, found, count] {
        let kept = limited(&flags, &order, budget);
        let wanted: Vec<u32> = (0..count as u32).filter(|&i| kept[i as usize]).collect();
        assert_eq!(list(Some((&mut ranking, budget))), wanted, "a budget of {budget}");
        assert_eq!(wanted.len(), budget.min(found));
    }
}

pub fn limit_active() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::LIMIT_ACTIVE, &[]).unwrap();
    let mut rng = random(7);
    for (count, budget) in [(1usize, 0u32), (1, 1), (64, 20), (65, 3), (3000, 1000), (3000, 4000)] {
        let flags: Vec<bool> = (0..count).map(|_| rng.random_range(0..3) > 0).collect();
        let mut order: Vec<u32> = (0..count as u32).collect();
        for i in 1..count {
            order.swap(i, rng.random_range(0..=i));
        }
        let (mut ranks, mut places) = (vec![0u32; count], vec![0u32]);
        for (rank, &splat) in (0..).zip(&order) {
            ranks[splat as usize] = rank;
            places.push(places[places.len() - 1] + u32::from(flags[splat as usize]));
        }
        let words: Vec<u32> = flags.iter().map(|&f| u32::from(f)).collect();
        let mut on_device = gpu.upload("flags", "test", &words).unwrap();
        let (places, ranks) = (gpu.upload("places", "test", &places), gpu.upload("ranks", "test", &ranks));
        let (places, ranks) = (places.unwrap(), ranks.unwrap());
        run(&gpu, |r| {
            r.pass(&kernel)
                .read("places", &places)
                .read("ranks", &ranks)
                .write("flags", &mut on_device)
                .push(&shaders_glsl::types::LimitParams { count: count as u32, budget })
                .dispatch_over(count as u32);
        });
        let wanted = limited(&flags, &order, budget as usize);
        assert_eq!(on_device.read().unwrap(), wanted.iter().map(|&f| u32::from(f)).collect::<Vec<_>>());
    }
}

pub fn list_active() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::LIST_ACTIVE, &[]).unwrap();
    let mut rng = random(6);
    for count in [1usize, 63, 64, 65, 5000] {
        let flags: Vec<u32> = (0..count).map(|_| rng.random_range(0..2)).collect();
        let mut places = vec![0u32];
        for flag in &flags {
            places.push(places[places.len() - 1] + flag);
        }
        let on_device = gpu.upload("places", "test", &places).unwrap();
        let numbers: Vec<u32> = (0..count as u32).map(|i| i * 7 % 256).collect();
        let numbers_on_device = gpu.upload("objects", "test", &numbers).unwrap();
        let mut active = gpu.buffer::<u32>("active", "test", count).unwrap();
        let mut objects = gpu.buffer::<u32>("active objects", "test", count).unwrap();
        run(&gpu, |r| {
            r.pass(&kernel)
                .read("places", &on_device)
                .read("objects", &numbers_on_device)
                .write("active_splats", &mut active)
                .write("active_objects", &mut objects)
                .push(&shaders_glsl::types::ListParams { count: count as u32 })
                .dispatch_over(count as u32);
        });
        let wanted: Vec<u32> = (0..count as u32).filter(|&i| flags[i as usize] == 1).collect();
        assert_eq!(active.read_range(0, wanted.len()).unwrap(), wanted);
        let wanted: Vec<u32> = wanted.iter().map(|&i| numbers[i as usize]).collect();
        assert_eq!(objects.read_range(0, wanted.len()).unwrap(), wanted);
    }
}
