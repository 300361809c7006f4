//! Mode alpha: quads, their order, and the picture that they make.

use engine::gpu::{Drawing, Gpu};
use engine::passes::Quads;
use engine::passes::SplatRows;
use engine::passes::quads::{QuadSources, QuadVariant};
use engine::render::{self, Camera, Look, LookBuffers, Target};
use engine::splat::harmonics::basis_count;
use engine::splat::{Harmonics, Splat};
use engine::transfer::{Light, Material, preset};
use glam::{DMat2, DVec2, DVec3, DVec4, Vec3};
use rand::RngExt;
use reference::eye::{Appearance, Eye};
use reference::hidden as hidden_reference;
use reference::quads;
use shaders_glsl::types::{AlphaParams, Centre, Quad, QuadParams, View};
use vgs_tests::rendering::SIDE_LIGHT;
use vgs_tests::scene::{random, splat};
use vgs_tests::{Bound, Device, assert_close};

use super::{hidden, run};

const SIZE: [u32; 2] = [60, 44];
const RANGE: [f64; 2] = [-300.0, 1300.0];
/// Key of what no view shows.
const LAST: u32 = (1 << shaders_glsl::project_quads::ORDER_BITS) - 1;
const CUT: [[f32; 4]; 2] = [[0.6, 0.0, 0.8, 18.0], [0.0, -1.0, 0.0, 25.0]];

/// What is drawn of a splat.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Kind {
    corners: u32,
    standard: bool,
    shaded: bool,
    objects: bool,
    /// Whether there are patches that no eye sees.
    hidden: bool,
}

const KINDS: [Kind; 7] = [
    Kind { corners: 6, standard: false, shaded: false, objects: false, hidden: false },
    Kind { corners: 3, standard: false, shaded: true, objects: false, hidden: false },
    Kind { corners: 3, standard: true, shaded: false, objects: false, hidden: false },
    Kind { corners: 6, standard: true, shaded: false, objects: false, hidden: true },
    Kind { corners: 6, standard: false, shaded: false, objects: true, hidden: false },
    Kind { corners: 3, standard: false, shaded: true, objects: true, hidden: true },
    Kind { corners: 3, standard: true, shaded: false, objects: true, hidden: false },
];

/// How objects are shown, by number; splat i belongs to object i % 3.
const OBJECTS: [render::Appearance; 3] = [
    render::Appearance { visible: true, tint: Some([0.25, 0.5, 1.0]), opacity: 0.4 },
    render::Appearance { visible: true, tint: None, opacity: 1.0 },
    render::Appearance { visible: true, tint: Some([1.0, 0.0, 0.125]), opacity: 1.0 },
];

/// Splats in mm about the origin, some of them left out, and two eyes: one asymmetric from outside, one wide from among
/// them.
struct Stage {
    splats: Vec<Splat>,
    /// Extinction times colour, and extinction, 1/mm.
    media: Vec<[f32; 4]>,
    centres: Vec<Centre>,
    harmonics: Harmonics,
    active: Vec<u32>,
    views: Vec<View>,
    look: Look,
    kind: Kind,
}

fn stage(seed: u64, count: usize, kind: Kind) -> Stage {
    let mut rng = random(seed);
    let splats: Vec<Splat> = (0..count)
        .map(|_| {
            let mut s = splat(&mut rng, Vec3::splat(60.0));
            s.mean = s.mean.map(|v| v - 30.0);
            s.log_scale = s.log_scale.map(|v| v + 0.3);
            s
        })
        .collect();
    let medium = |_| {
        let extinction = rng.random_range(0.0f32..0.9).powi(2) + 1e-9;
        // A colour may be a little brighter than white.
        let mut colour = || extinction * rng.random_range(0.0f32..1.05);
        [colour(), colour(), colour(), extinction]
    };
    let media = (0..count).map(medium).collect();
    let centre = |_| Centre {
        slope: std::array::from_fn(|_| rng.random_range(-50.0f32..50.0)),
        occupancy_slope: std::array::from_fn(|_| rng.random_range(-0.1f32..0.1)),
    };
    let centres = (0..count).map(centre).collect();
    // Quarters: the device keeps halves of them exactly.
    let degree = (seed % 4) as u8;
    let coefficients =
        (0..count * basis_count(degree) * 3).map(|_| rng.random_range(-6i32..7) as f32 * 0.25).collect();
    let outside =
        Camera::from_side("anterior-left-superior", DVec3::ZERO, 40.0, 40.0, 1.3).expect("a camera");
    let inside =
        Camera::from_side("posterior", DVec3::new(2.0, -30.0, 1.0), 20.0, 150.0, 1.3).expect("a camera");
    let mut views: Vec<View> = [outside, inside].iter().map(|c| c.view(DVec3::ZERO)).collect();
    views[0].tangents[0] *= 0.6;
    views[0].tangents[3] *= 1.2;
    let mut transfer = preset("CT-Bone").unwrap().over([-1000.0, 2000.0]);
    transfer.material = Material {
        shade: kind.shaded,
        ambient: 0.2,
        diffuse: 0.7,
        specular: 0.3,
        power: 12.0,
        occlusion: 0.0,
    };
    Stage {
        splats,
        media,
        centres,
        harmonics: Harmonics { degree, coefficients },
        active: (0..count as u32).filter(|i| i % 11 != 3).collect(),
        views,
        look: Look {
            objects: (0..).zip(OBJECTS).collect(),
            light: if kind.objects { SIDE_LIGHT } else { Light::default() },
            ..Look::new(transfer)
        },
        kind,
    }
}

impl Stage {
    fn params(&self) -> QuadParams {
        QuadParams {
            size: SIZE,
            centre: [1.0, -2.0, 0.5],
            radius: 75.0,
            view_count: self.views.len() as u32,
            splat_count: self.splats.len() as u32,
            coefficients: basis_count(self.harmonics.degree) as u32,
            ..QuadParams::default()
        }
    }

    fn eyes(&self) -> Vec<Eye> {
        self.views.iter().map(Into::into).collect()
    }

    /// The quads of all active splats by the reference implementation, with their places among these.
    fn wanted(&self, view: usize, eye: &Eye, dark: f32) -> Vec<Option<quads::Quad>> {
        let look = quads::Look {
            material: &self.look.transfer.material,
            light: &self.look.light,
            dark: f64::from(dark),
            planes: &CUT.map(|p| p.map(f64::from)),
            widening: 0.3,
        };
        let patches = hidden::lens_and_inset();
        let quad = |&i: &u32| {
            let (i, splat) = (i as usize, (&self.splats[i as usize]).into());
            let own = |s: &reference::Splat| {
                let direction = (s.mean - eye.position).normalize().to_array();
                quads::Face::Own(DVec3::from_array(self.harmonics.colour(i, direction)))
            };
            let medium = DVec4::from_array(self.media[i].map(f64::from));
            let face = match self.kind.standard {
                true => own(&splat),
                false => quads::Face::Medium(medium, &self.centres[i]),
            };
            let object = if self.kind.objects { appearance(i) } else { Appearance::default() };
            quads::quad(&splat, &face, &object, eye, SIZE, &look).filter(|quad| {
                let half_size = DVec2::new(quad.covariance.x_axis.x, quad.covariance.y_axis.y) * quad.edge();
                let unseen = hidden::of(&patches, view);
                !self.kind.hidden
                    || !hidden_reference::rectangle_is_hidden(
                        &unseen,
                        quad.centre,
                        half_size.map(f64::sqrt),
                        SIZE,
                    )
            })
        };
        self.active.iter().map(quad).collect()
    }
}

/// How the object of a splat is shown.
fn appearance(splat: usize) -> Appearance {
    let object = OBJECTS[splat % 3];
    let tint = object.tint.map_or(DVec4::ZERO, |t| Vec3::from_array(t).as_dvec3().extend(1.0));
    Appearance { tint, opacity: f64::from(object.opacity) }
}

/// What the passes leave.
struct Made {
    quads: Quads,
    keys: Vec<u32>,
    dark: f32,
}

fn made(gpu: &Gpu, stage: &Stage) -> Made {
    let Kind { corners, standard, shaded, objects, hidden } = stage.kind;
    let mut look = LookBuffers::new(gpu, &stage.look, RANGE, DVec3::ZERO).unwrap();
    let mut row = look.rows.read().unwrap()[0];
    row.plane_count = 2;
    row.planes[..2].copy_from_slice(&CUT);
    look.rows.write_range(0, &[row]).unwrap();
    let half = |v: f32| u32::from(half_bits(v));
    let words: Vec<u32> = (stage.harmonics.coefficients.chunks(2))
        .map(|pair| half(pair[0]) | pair.get(1).map_or(0, |&v| half(v)) << 16)
        .collect();
    let views = hidden::views(gpu, &stage.views, &if hidden { hidden::lens_and_inset() } else { Vec::new() });
    let splats = SplatRows::full(gpu, &stage.splats).unwrap();
    let media = gpu.upload("media", "test", &stage.media).unwrap();
    let centres = gpu.upload("centres", "test", &stage.centres).unwrap();
    let harmonics = gpu.upload("harmonics", "test", &words).unwrap();
    let active = gpu.upload("active", "test", &stage.active).unwrap();
    let count = gpu.upload("count", "test", &[stage.active.len() as u32]).unwrap();
    let numbers: Vec<u32> = stage.active.iter().map(|i| i % 3).collect();
    let numbers = gpu.upload("objects", "test", &numbers).unwrap();
    let sources = QuadSources {
        look: (&look.rows, &look.points, &look.integrals),
        splats: &splats,
        media: &media,
        centres: &centres,
        harmonics: &harmonics,
        active: (&active, &count),
        objects: (&numbers, &look.appearances),
    };
    let variant = QuadVariant { corners, standard, shaded, packed: false, objects, hidden };
    let kernel = Quads::kernel(gpu, variant).unwrap();
    let mut quads = Quads::new(gpu, stage.views.len() as u32, stage.splats.len()).unwrap();
    run(gpu, |r| quads.record(r, &kernel, &views, &sources, &stage.params()));
    let keys = quads.sorted_keys().read_range(0, stage.active.len()).unwrap();
    Made { quads, keys, dark: row.dark }
}

/// A quarter as a half.
fn half_bits(v: f32) -> u16 {
    if v == 0.0 {
        0
    } else {
        ((v.to_bits() >> 16 & 0x8000) | ((v.to_bits() & 0x7FFF_FFFF) - (112 << 23)) >> 13) as u16
    }
}

/// Covariance of a quad's ellipse in pixels².
fn covariance(quad: &Quad) -> DMat2 {
    let [x, y, z] = quad.axes.map(f64::from);
    let half = DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1])) * 0.5;
    let axes = DMat2::from_diagonal(half) * DMat2::from_cols(DVec2::new(x, 0.0), DVec2::new(y, z));
    axes * axes.transpose() * (1.0 / 6.0)
}

pub fn project_quads() {
    let gpu = Device::boot();
    for (seed, kind) in (4..).zip(KINDS) {
        let stage = stage(seed, 400, kind);
        let Made { quads, keys, dark } = made(&gpu, &stage);
        let rows = quads.rows.read().unwrap();
        let order = quads.order().read_range(0, stage.active.len()).unwrap();
        let eyes = stage.eyes();
        let mut shown = vec![false; stage.active.len()];
        let (mut places, mut shapes, mut values, mut colours, mut edges) =
            (vec![], vec![], vec![], vec![], vec![]);
        let mut disagreed = 0;
        for (v, eye) in eyes.iter().enumerate() {
            for (i, wanted) in stage.wanted(v, eye, dark).iter().enumerate() {
                let got = &rows[v * stage.splats.len() + i];
                shown[i] |= got.edge > 0.0;
                let (Some(wanted), true) = (wanted, got.edge > 0.0) else {
                    // At the border of what is seen either may be right.
                    disagreed += usize::from(wanted.is_some() != (got.edge > 0.0));
                    continue;
                };
                let size = DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]));
                let centre = (DVec2::from_array(got.centre.map(f64::from)) + 1.0) * 0.5 * size;
                // In units of the ellipse, which may be far larger than the picture.
                let spread = wanted.covariance.to_cols_array();
                let unit = spread[0].max(spread[3]);
                places.push(((centre - wanted.centre).length() / unit.sqrt().max(1.0), 0.0));
                shapes.extend(
                    covariance(got).to_cols_array().iter().zip(spread).map(|(g, w)| (g / unit, w / unit)),
                );
                values.push((f64::from(got.thickness), wanted.thickness));
                values.push((f64::from(got.depth), wanted.depth));
                edges.push((6.0 * f64::from(got.edge).powi(2), wanted.edge()));
                colours
                    .extend(got.colour.iter().zip(wanted.colour.to_array()).map(|(&g, w)| (f64::from(g), w)));
            }
        }
        let name = format!("project_quads, {kind:?}");
        assert!(values.len() > 200, "{name}: {} quads are too few to tell", values.len() / 2);
        assert!(disagreed <= 2, "{name}: {disagreed} quads are there for one and not for the other");
        assert_close(&format!("{name}: centres"), Bound::new(1e-4, 0.0), places);
        assert_close(&format!("{name}: ellipses"), Bound::new(2e-4, 0.0).outliers(0.01, 1e-2), shapes);
        // The opacity per mm of a faint tissue is a difference of numbers near 1.
        let relative = if kind.objects { 1e-3 } else { 1e-4 };
        assert_close(&format!("{name}: thickness, depth"), Bound::new(1e-6, relative), values);
        assert_close(&format!("{name}: edges"), Bound::new(1e-3, 1e-4), edges);
        assert_close(&format!("{name}: colours"), Bound::new(2e-3, 1e-4), colours);

        // The order: back to front, by steps of the scene's ball, equal ones as they were; what is not seen comes last.
        let count = shown.iter().filter(|s| **s).count();
        assert_eq!(quads.arguments.read().unwrap(), [[count as u32 * kind.corners, 1, 0, 0]], "{name}");
        assert!(order[..count].iter().all(|&i| shown[i as usize]), "{name}: what is seen comes first");
        assert!(
            keys[count..].iter().all(|&k| k == LAST) && keys[..count].iter().all(|&k| k < LAST),
            "{name}"
        );
        let away = |i: u32| quads::behind(&(&stage.splats[stage.active[i as usize] as usize]).into(), &eyes);
        for (pair, key) in order[..count].windows(2).zip(keys.windows(2)) {
            assert!(
                away(pair[0]) > away(pair[1]) - 2e-3,
                "{name}: {} before {}",
                away(pair[0]),
                away(pair[1])
            );
            assert!(key[0] < key[1] || key[0] == key[1] && pair[0] < pair[1], "{name}: stable");
        }
    }
}

#[test]
fn the_picture_of_alpha_is_that_of_its_reference() {
    let gpu = Device::boot();
    for (seed, kind) in (24..).zip(KINDS) {
        let stage = stage(seed, 250, kind);
        let Made { quads, dark, .. } = made(&gpu, &stage);
        let mut target = Target::new(&gpu, SIZE, 2, true, true).unwrap();
        let constants = [kind.corners, u32::from(kind.standard)];
        let formats = [target.colour.format(), target.depth.format()];
        let fragment = &shaders_glsl::ALPHA_DEPTH_FRAG;
        let drawing =
            Drawing::new(&gpu, &shaders_glsl::ALPHA_VERT, fragment, &constants, &formats, 2).unwrap();
        run(&gpu, |r| {
            r.draw(&drawing)
                .read("quads", &quads.rows)
                .read("order", quads.order())
                .push(&AlphaParams { splat_count: stage.splats.len() as u32 })
                .over(&mut [&mut target.colour, &mut target.depth], &quads.arguments, 0);
        });
        let depths: Vec<f32> = target.depth.read().unwrap();
        let order = quads.order().read_range(0, stage.active.len()).unwrap();
        let (mut colours, mut depth_pairs, mut filled) = (vec![], vec![], 0);
        for (v, eye) in stage.eyes().iter().enumerate() {
            let wanted = stage.wanted(v, eye, dark);
            let nearest_first: Vec<_> = order.iter().rev().filter_map(|&i| wanted[i as usize]).collect();
            let got = target.read_colour(v as u32).unwrap();
            for (i, pixel) in got.iter().enumerate() {
                let place = DVec2::new((i as u32 % SIZE[0]) as f64 + 0.5, (i as u32 / SIZE[0]) as f64 + 0.5);
                let wanted = quads::pixel(&nearest_first, place);
                filled += usize::from(wanted.clear < 0.5);
                colours.extend(pixel.iter().zip(wanted.pixel()).map(|(&g, w)| (f64::from(g), w)));
                depth_pairs.push((f64::from(depths[v * got.len() + i]), wanted.depth));
            }
        }
        let name = format!("alpha, {kind:?}");
        assert!(filled > 500, "{name}: the scene is to be seen: {filled}");
        // At the edge of an ellipse the opacity falls by 1/255, for the one or for the other.
        // Corners lie on sixteenths of a pixel on SwiftShader, not on 256ths: 4.8 % of the depths are off there.
        let is_rough = gpu.description().driver.contains("SwiftShader");
        let (share, most) = if is_rough { (0.06, [0.2, 10.0]) } else { (0.005, [0.05, 5.0]) };
        assert_close(&name, Bound::new(2.0 / 255.0, 0.0).outliers(share, most[0]), colours);
        assert_close(&format!("{name}, depth"), Bound::new(0.3, 5e-3).outliers(share, most[1]), depth_pairs);
    }
}
