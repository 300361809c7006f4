//! Foveation: what the eyes see of insets and surrounds, in colour and depth, on all levels and behind round
//! lenses.

use crate::support::{all_levels, device, options, script, session, silent};
use engine::gpu::Gpu;
use engine::render::{Camera, Renderer, Settings, VisibilityMask, mode};
use glam::DVec3;
use xr_app::headset::simulated::{Script, Simulated};
use xr_app::headset::{Headset as _, Pose};
use xr_app::sight::{FADING, Inset, Sight};
use xr_app::viewer::{Options, Viewer};

const SIZE: [u32; 2] = [96, 112];
const PART: f64 = 0.5;

fn foveated(level: Option<usize>) -> Options {
    Options { foveation: Some(PART), level, ..options() }
}

/// Returns a head that goes near to the patient, who then is wider than the insets.
fn nearing(seconds: f64) -> (Pose, bool) {
    let position = if seconds < 0.05 { DVec3::ZERO } else { DVec3::new(0.0, 0.0, -0.48) };
    (Pose { position, ..Pose::IDENTITY }, true)
}

/// Returns where the insets of a session lay: it puts them straight ahead of fields of view that do not
/// change.
fn insets(headset: &Simulated) -> [Inset; 2] {
    let mut sight = Sight::new(SIZE, Some(PART), false);
    sight.update(&Default::default(), &headset.shown.expect("a frame"));
    sight.aim();
    *sight.insets().expect("insets")
}

/// Returns how much of a pixel is the inset's: 1 where it shows all, 0 outside.
fn share([x, y]: [u32; 2], [left, up, right, down]: Inset) -> f64 {
    let at = [(f64::from(x) + 0.5) / f64::from(SIZE[0]), (f64::from(y) + 0.5) / f64::from(SIZE[1])];
    let side = |to: f64, edge: f64, of_picture: bool| if of_picture { 1.0 } else { to / (edge * FADING) };
    let (wide, high) = (right - left, down - up);
    let sides = [
        side(at[0] - left, wide, left <= 0.0),
        side(right - at[0], wide, right >= 1.0),
        side(at[1] - up, high, up <= 0.0),
        side(down - at[1], high, down >= 1.0),
    ];
    let t = sides.into_iter().fold(1.0, f64::min).max(0.0);
    t * t * (3.0 - 2.0 * t)
}

/// Pictures of a size that the renderer makes of both eyes, with the mean depth times the opacity, mm.
fn rendered(
    gpu: &Gpu,
    viewer: &Viewer,
    headset: &Simulated,
    name: &str,
    size: [u32; 2],
) -> [Vec<[f32; 5]>; 2] {
    let cameras: [Camera; 2] = headset.shown.expect("a frame").map(|eye| viewer.placement().camera(&eye));
    let settings = Settings { views: 2, depth: true, ..Settings::new(size) };
    let mut renderer =
        Renderer::new(gpu, mode(name).expect("a mode"), viewer.scene(), &settings).expect("a renderer");
    renderer.render(viewer.scene(), &cameras).expect("a picture");
    [0, 1].map(|eye| {
        let colours = renderer.target.read_colour(eye).expect("colours");
        let depths = renderer.target.read_depth(eye).expect("depths");
        let pixel =
            |([r, g, b, a], depth): ([f32; 4], f32)| [r, g, b, a, if a > 0.0 { depth * a } else { 0.0 }];
        colours.into_iter().zip(depths).map(pixel).collect()
    })
}

/// Returns a place of a picture as a sampler sees it: linear between the four pixels around it.
fn sampled(picture: &[[f32; 5]], size: [u32; 2], place: [f64; 2]) -> [f64; 4] {
    let at: [f64; 2] = [0, 1].map(|axis| (place[axis] * f64::from(size[axis]) - 0.5).max(0.0));
    let pixel = |dx: u32, dy: u32| {
        let [x, y] = [(at[0] as u32 + dx).min(size[0] - 1), (at[1] as u32 + dy).min(size[1] - 1)];
        picture[(y * size[0] + x) as usize]
    };
    let [u, v] = at.map(f64::fract);
    let corners =
        [(0, 0, (1.0 - u) * (1.0 - v)), (1, 0, u * (1.0 - v)), (0, 1, (1.0 - u) * v), (1, 1, u * v)];
    std::array::from_fn(|c| corners.iter().map(|&(x, y, w)| w * f64::from(pixel(x, y)[c])).sum())
}

/// In the inset the eyes see what they see without foveation, around it a smaller picture enlarged, in
/// between a mixture; in both modes.
#[test]
fn the_inset_is_the_whole_picture_and_the_surround_a_smaller_one() {
    let gpu = device();
    let last = all_levels().len() - 1;
    for (level, name) in [(0, "slab"), (last, "alpha")] {
        let full =
            engine::render::QualityLevel { quality: engine::render::Quality::FULL, ..all_levels()[level] };
        assert_eq!(full.mode, name);
        let options = Options { levels: vec![full], ..foveated(Some(0)) };
        let (viewer, headset) = session(&gpu, Script { head: nearing, ..script(14) }, options);
        assert_eq!(viewer.shown_size(), [48, 56]);
        let insets = insets(&headset);
        let whole = rendered(&gpu, &viewer, &headset, name, SIZE);
        let small = rendered(&gpu, &viewer, &headset, name, [48, 56]);
        let found: Vec<[u8; 4]> = headset.picture().read().expect("the picture");
        let (mut seen, mut within, mut around, mut off) = (0, 0, 0, 0);
        for (eye, y, x) in
            (0..2).flat_map(|e| (0..SIZE[1]).flat_map(move |y| (0..SIZE[0]).map(move |x| (e, y, x))))
        {
            let pixel = (y * SIZE[0] + x) as usize;
            let share = share([x, y], insets[eye]);
            let place =
                [(f64::from(x) + 0.5) / f64::from(SIZE[0]), (f64::from(y) + 0.5) / f64::from(SIZE[1])];
            let fine = whole[eye][pixel].map(f64::from);
            let coarse = sampled(&small[eye], [48, 56], place);
            let mixed: [f64; 4] = std::array::from_fn(|c| coarse[c] + (fine[c] - coarse[c]) * share);
            let got = found[eye * whole[eye].len() + pixel];
            for (channel, background) in [0.2, 0.1, 0.0].into_iter().enumerate() {
                let wanted = (mixed[channel] + (1.0 - mixed[3]) * background).clamp(0.0, 1.0) * 255.0;
                let distance = (f64::from(got[channel]) - wanted).abs();
                // A device weighs four texels in steps of 1/256; an intensity between two entries of the
                // table may take either.
                off += usize::from(distance > if share == 1.0 { 1.0 } else { 2.0 });
                assert!(distance <= 6.0, "{name}: {got:?}, not {mixed:?} at {x}, {y}, share {share}");
            }
            seen += usize::from(mixed[3] > 0.5);
            within += usize::from(share == 1.0 && mixed[3] > 0.5);
            around += usize::from(share < 1.0 && mixed[3] > 0.05);
        }
        assert!(within > 20 && around > 20, "{name}: {within} pixels in the insets, {around} around");
        assert!(off * 200 <= seen, "{name}: {off} of {seen} are off");
    }
    silent(&gpu);
}

/// Depth in the inset is that of the whole picture, around it that of the smaller one; in between it lies
/// between them.
#[test]
fn depth_is_that_of_what_is_seen() {
    let gpu = device();
    let (viewer, headset) =
        session(&gpu, Script { head: nearing, depth: true, ..script(14) }, foveated(Some(0)));
    let insets = insets(&headset);
    let whole = rendered(&gpu, &viewer, &headset, "slab", SIZE);
    let small = rendered(&gpu, &viewer, &headset, "slab", [48, 56]);
    let found: Vec<f32> = headset.depth().expect("depth is taken").read().expect("texels");
    let [near, far] = xr_app::headset::DEPTH_RANGE;
    let mut counts = [0, 0, 0];
    for (eye, y, x) in
        (0..2).flat_map(|e| (0..SIZE[1]).flat_map(move |y| (0..SIZE[0]).map(move |x| (e, y, x))))
    {
        let pixel = (y * SIZE[0] + x) as usize;
        let depth = f64::from(found[eye * whole[eye].len() + pixel]);
        assert!(depth.is_finite());
        let share = share([x, y], insets[eye]);
        let [fine, coarse] = [whole[eye][pixel], small[eye][(y / 2 * 48 + x / 2) as usize]]
            .map(|p| [p[3], p[4]].map(f64::from));
        let opacity = coarse[0] + (fine[0] - coarse[0]) * share;
        if opacity < 0.06 {
            continue;
        }
        let mm = (coarse[1] + (fine[1] - coarse[1]) * share) / opacity;
        let metres = far * near / (far - depth * (far - near));
        assert!((metres - mm * 1e-3).abs() < 5e-4, "{metres} m, not {mm} mm at {x}, {y}, share {share}");
        counts[if share == 1.0 {
            0
        } else if share > 0.0 {
            1
        } else {
            2
        }] += 1;
    }
    assert!(counts[0] > 20 && counts[1] + counts[2] > 20, "{counts:?}");
    silent(&gpu);
}

/// The controller moves along the quality levels as ever, and no frame allocates or makes anything, behind
/// round lenses neither; what they hide is background.
#[test]
fn levels_and_lenses_work_as_without() {
    let gpu = device();
    let tight = Options { budget_ms: Some(1e-6), ..foveated(None) };
    let (viewer, headset) = session(&gpu, Script { round_from: Some(20), ..script(60) }, tight);
    let report = viewer.report(&headset);
    assert_eq!((report.allocations, report.pipelines), (0, 0));
    let last = report.samples.last().expect("frames").level;
    assert_eq!(last, all_levels().len() - 1, "down to the last level");
    let found: Vec<[u8; 4]> = headset.picture().read().expect("the picture");
    let eyes = headset.shown.expect("a frame");
    for (eye, of) in eyes.iter().enumerate() {
        let mask = VisibilityMask::of(&of.fov, &headset.lenses()[eye]);
        assert!((mask.share() - report.hidden[eye]).abs() < 1e-12 && mask.share() > 0.17);
    }
    assert!(found[0][0] == 51 && found[0][2] == 0, "a corner is background: {:?}", found[0]);
    silent(&gpu);
}
