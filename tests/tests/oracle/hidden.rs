//! What of pictures no eye sees, by the parts of tiles; and hidden patches for the tests of what leaves these
//! out.

use engine::gpu::{Gpu, Kernel};
use engine::passes::Views;
use engine::passes::tiles::TILE;
use rand::RngExt;
use reference::hidden;
use shaders_glsl::types::{HiddenParams, PATCH_WORDS, PATCHES, View};
use vgs_tests::Device;
use vgs_tests::scene::random;

use super::run;

/// Patches of which those are hidden that `hidden` names, by view and place.
pub fn patches(views: usize, hidden: impl Fn(usize, [usize; 2]) -> bool) -> Vec<u32> {
    let mut words = vec![0; views * PATCH_WORDS];
    for (view, y, x) in
        (0..views).flat_map(|v| (0..PATCHES * PATCHES).map(move |i| (v, i / PATCHES, i % PATCHES)))
    {
        words[view * PATCH_WORDS + 2 * y + x / 32] |= u32::from(hidden(view, [x, y])) << (x % 32);
    }
    words
}

/// What a round lens hides of a view, and what an inset covers of the next.
pub fn lens_and_inset() -> Vec<u32> {
    patches(2, |view, [x, y]| {
        let [x, y] = [x, y].map(|n| n as f64 - 31.5);
        if view == 0 { x.hypot(y) > 26.0 } else { x.abs() < 13.0 && y.abs() < 17.0 }
    })
}

/// Whether a patch of a view is hidden.
pub fn of(words: &[u32], view: usize) -> impl Fn([usize; 2]) -> bool {
    move |[x, y]| words[view * PATCH_WORDS + 2 * y + x / 32] >> (x % 32) & 1 == 1
}

/// Views for passes; without patches where there are no words of them.
pub fn views(gpu: &Gpu, rows: &[View], words: &[u32]) -> Views {
    let words = if words.is_empty() { &[0][..] } else { words };
    Views {
        rows: gpu.upload("views", "test", rows).unwrap(),
        patches: gpu.upload("patches", "test", words).unwrap(),
    }
}

pub fn hidden_parts() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::HIDDEN_PARTS, &[]).unwrap();
    let mut rng = random(17);
    let holes: Vec<_> = (0..60).map(|_| [(); 3].map(|()| rng.random_range(0..PATCHES))).collect();
    let scattered = patches(2, |view, [x, y]| {
        !holes.contains(&[x, y, x]) && !holes.iter().any(|h| h[view..][..2] == [x, y])
    });
    for words in [lens_and_inset(), scattered, patches(2, |view, _| view == 0)] {
        for size in [[52u32, 40], [64, 64], [300, 217], [99, 640], [1, 1], [17, 900]] {
            let tiles = size.map(|n| n.div_ceil(TILE));
            let count = tiles[0] * tiles[1];
            let on_device = gpu.upload("patches", "test", &words).unwrap();
            let mut parts = gpu.buffer::<u32>("parts", "test", 2 * count as usize).unwrap();
            run(&gpu, |r| {
                r.pass(&kernel)
                    .read("patches", &on_device)
                    .write("hidden_parts", &mut parts)
                    .push(&HiddenParams { size, tiles })
                    .dispatch_over_3d([count, 2, 1]);
            });
            let wanted: Vec<u32> = (0..2 * count)
                .map(|i| {
                    let (view, tile) = ((i / count) as usize, i % count);
                    hidden::hidden_parts(&of(&words, view), [tile % tiles[0], tile / tiles[0]], size)
                })
                .collect();
            assert_eq!(parts.read().unwrap(), wanted, "{size:?}");
        }
    }
}
