//! Baking as a whole; its program is tested with the others.

use std::ops::ControlFlow;

use engine::bake::{Options, Views, pictures, train};
use engine::image::Image;
use engine::render::{Look, Scene, baked};
use engine::splat::SplatSet;
use engine::transfer::preset;
use glam::Vec3;
use vgs_tests::Device;
use vgs_tests::scene::{random, splat};

/// Pixels of small pictures, and of large ones: the middle of a small one is that of a large one.
const SMALL: u32 = 40;
const LARGE: u32 = 3 * SMALL;

/// Every third pixel of a large picture, from the second.
fn sampled(picture: &Image) -> Image {
    let [small, large] = [SMALL, LARGE].map(|edge| edge as usize);
    let at = |i: usize| (3 * (i / small) + 1) * large + 3 * (i % small) + 1;
    Image { size: [small; 2], pixels: (0..small * small).map(|i| picture.pixels[at(i)]).collect() }
}

/// Training with small pictures is training with pixels of the large ones that the splats are made for.
#[test]
fn small_pictures_are_pixels_of_large_ones() {
    let gpu = Device::boot();
    let mut rng = random(7);
    let mut one = |_| {
        let mut s = splat(&mut rng, Vec3::splat(40.0));
        s.intensity = 400.0;
        s
    };
    let set = SplatSet { splats: (0..200).map(&mut one).collect(), ..SplatSet::default() };
    let look = Look::new(preset("CT-Bone").expect("a preset").over([-1024.0, 3071.0]));
    let scene = Scene::new(&gpu, Some(&set), None, &look).expect("a scene");
    let views = |size| {
        let views = Views::of_scene(&gpu, &scene, "decoded", (3, 0.0), size, &mut |_| true);
        views.expect("pictures").expect("all of them")
    };
    let [small, large] = [SMALL, LARGE].map(views);
    let first = baked(&gpu, &set, &look).expect("splats").set;
    let drawn = pictures(&gpu, &first, &large).expect("pictures");
    let wanted = large.pictures().expect("pictures");
    let degree = first.colours.as_ref().expect("colours").degree;
    let options = Options { iterations: 0, size: SMALL, shown: LARGE, ..Options::default() };
    let trained = train(&gpu, first.clone(), degree, [&small, &small], &options, None, &mut |_, _| {
        ControlFlow::Continue(())
    });
    let told = trained.expect("no steps").report.after;
    let of_small = pictures(&gpu, &first, &small).expect("pictures");
    for (i, &told) in told.iter().enumerate() {
        let db = |drawn: &Image| engine::image::psnr(drawn, &sampled(&wanted[i])).expect("of one size");
        let (right, wider) = (db(&sampled(&drawn[i])), db(&of_small[i]));
        println!(
            "view {i}: {told:.2} dB told, {right:.2} dB of the large picture, {wider:.2} dB of the small one"
        );
        assert!((told - right).abs() < 0.02, "{told} for {right}");
        assert!((wider - right).abs() > 0.1, "the widening makes a difference");
    }
}
