//! The table against the function it was made from, over random functions.

use proptest::prelude::*;

use super::*;
use crate::{ColourPoint, Material, OpacityPoint, PRESETS};

const CT: [f64; 2] = [-1024.0, 3071.0];

fn tf(colours: &[(f64, [f64; 3])], opacities: &[(f64, f64)]) -> TransferFunction {
    let colours = colours.iter().map(|&(intensity, c)| ColourPoint { intensity, colour: DVec3::from(c) });
    let opacities = opacities.iter().map(|&(intensity, opacity)| OpacityPoint { intensity, opacity });
    TransferFunction::new("t", colours.collect(), opacities.collect(), Material::default()).unwrap()
}

fn white(opacities: &[(f64, f64)]) -> TransferFunction {
    tf(&[(0.0, [1.0; 3])], opacities)
}

/// Returns by brute force the mean colour (weighted with the extinction) and mean extinction between two
/// intensities.
fn mean(tf: &TransferFunction, va: f64, vb: f64) -> (DVec3, f64) {
    const N: usize = 4000;
    let (mut colours, mut sum) = (DVec3::ZERO, 0.0);
    for i in 0..N {
        let v = va + (vb - va) * (i as f64 + 0.5) / N as f64;
        let extinction = tf.extinction(v);
        colours += tf.at(v).0 * extinction;
        sum += extinction;
    }
    (if sum > 0.0 { colours / sum } else { DVec3::ZERO }, sum / N as f64)
}

#[test]
fn the_size_follows_the_intensities_that_matter() {
    // (opacity points, range, first, step, length)
    let full = white(&[(-3024.0, 0.1), (5000.0, 0.9)]);
    let bone = white(&[(-3024.0, 0.0), (150.0, 0.0), (500.0, 0.8), (3071.0, 0.8)]);
    let band = white(&[(-180.0, 0.0), (-150.0, 0.5), (-120.0, 0.0)]);
    let open = [f64::NEG_INFINITY, f64::INFINITY];
    for (tf, range, first, step, len) in [
        (&full, CT, -1025.0, 1.0, 4098),
        (&full, open, -3025.0, 1.0, 8027),
        (&bone, CT, 149.5, 0.5, 5845),
        (&band, CT, -180.0 - 1.0 / 128.0, 1.0 / 128.0, 7683),
        (&white(&[(0.0, 0.1), (0.5, 0.3)]), open, -1.0 / 8192.0, 1.0 / 8192.0, 4099),
        (&white(&[(0.0, 0.0), (1e6, 0.5)]), open, -16.0, 16.0, 62_503),
        (&white(&[(1e6, 0.0), (1e6, 0.5)]), open, 1e6 - 0.25, 0.25, 4096),
        (&white(&[(0.0, 0.0)]), CT, -(2f64.powi(-40)), 2f64.powi(-40), 4096),
    ] {
        let table = Table::new(tf, range);
        let shape = (table.first, table.step, table.len(), table.integrals.len());
        assert_eq!(shape, (first, step, len, len), "{:?}", tf.opacities());
    }
    // Nothing can be seen in the range: the table is empty air, whatever the function does elsewhere.
    let above = Table::new(&bone, [-1000.0, 100.0]);
    assert_eq!(above.point(-500.0).1, 0.0);
    assert_eq!(above.segment(-500.0, 90.0).1, 0.0);
}

#[test]
fn a_step_of_one_hu_sits_where_it_belongs() {
    // N24: at most 1 HU off, in both rows, wherever the step is and whatever else makes the table long.
    for (at, more) in [(200.0, None), (200.5, None), (-37.25, Some(2900.0)), (1234.9, Some(-1000.0))] {
        let ramp = [(at - 0.5, 0.0), (at + 0.5, 1.0), (at + 500.0, 1.0)];
        let mut points = ramp.to_vec();
        points.extend(more.map(|v| (v, if v > at { 1.0 } else { 0.0 })));
        let tf = white(&points);
        let table = Table::new(&tf, CT);
        assert!(table.step <= 1.0);
        let half = 0.5f64;
        let rise = |f: &dyn Fn(f64) -> f64| {
            (-4000..4000).map(|i| at + f64::from(i) / 1000.0).find(|&v| f(v) > half).unwrap()
        };
        let truth = rise(&|v| tf.extinction(v));
        let shown = rise(&|v| table.point(v).1);
        assert!((shown - truth).abs() <= table.step, "point: {shown} against {truth}");
        // From well below to v the integral is 0 until the step is reached.
        let first = rise(&|v| table.segment(at - 100.0, v).1 * (v - at + 100.0));
        let exact = rise(&|v| mean(&tf, at - 1.0, v.max(at - 1.0)).1 * (v - at + 1.0));
        assert!((first - exact).abs() <= 1.0, "segment: {first} against {exact}");
    }
}

#[test]
fn entries_are_exact_and_the_middle_between_two_belongs_to_the_upper() {
    let tf = white(&[(0.0, 0.0), (4095.0, 0.819)]);
    let table = Table::new(&tf, [0.0, 4095.0]);
    assert_eq!(table.step, 1.0);
    for hu in [0.0, 1.0, 40.0, 4095.0] {
        assert_eq!(table.point(hu).1, f64::from(tf.extinction(hu) as f32));
    }
    assert_eq!(table.point(40.5), table.point(41.0));
    assert_eq!(table.point(40.499), table.point(40.0));
    // A segment below one entry is the point in its middle, and either direction is the same.
    assert_eq!(table.segment(40.2, 40.4), table.point(40.3));
    assert_eq!(table.segment(100.0, 900.0), table.segment(900.0, 100.0));
}

/// Factors over the gradient are those of the function to the width of an entry, however far its last point lies; and 1
/// without any.
#[test]
fn gradient_factors_follow_the_function() {
    let graded = |points: &[(f64, f64)]| {
        let points = points.iter().map(|&(intensity, opacity)| OpacityPoint { intensity, opacity });
        let tf = white(&[(0.0, 0.0), (100.0, 1.0)]).with_gradient_opacity(points.collect()).unwrap();
        Table::new(&tf, CT)
    };
    assert!([0.0, 3.0, 1e30].iter().all(|&g| graded(&[]).gradient_factor(g) == 1.0));
    let constant = graded(&[(-5.0, 0.25), (900.0, 0.25)]);
    assert!([0.0, 899.0, 1e30].iter().all(|&g| constant.gradient_factor(g) == 0.25));
    // A tail as far as Slicer's functions have it takes no entries from the ramp.
    let ramp = graded(&[(0.0, 0.0), (30.0, 0.0), (120.0, 0.8), (4000.0, 0.8), (1e9, 0.8)]);
    for i in 0..2000 {
        let g = f64::from(i) * 0.1;
        let wanted = ((g - 30.0) / 90.0).clamp(0.0, 1.0) * 0.8;
        let error = (ramp.gradient_factor(g) - wanted).abs();
        assert!(error < 0.8 / 90.0 * ramp.gradient_step, "{g}: {error}");
    }
    // A step is as wide as an entry; nothing is beyond a function that lies below 0.
    let step = graded(&[(50.0, 0.0), (50.0, 1.0)]);
    assert_eq!((step.gradient_factor(49.0), step.gradient_factor(50.0)), (0.0, 1.0));
    assert_eq!(graded(&[(-20.0, 0.0), (-10.0, 0.5)]).gradient_factor(7.0), 0.5);
    let tiny = graded(&[(0.0, 0.0), (1e-300, 1.0)]);
    assert!(tiny.gradient_step > 0.0 && ((1.0 / tiny.gradient_step) as f32).is_finite());
}

#[test]
fn beyond_its_ends_the_table_goes_on() {
    let tf = tf(&[(0.0, [1.0, 0.0, 0.0]), (100.0, [0.0, 0.0, 1.0])], &[(0.0, 0.2), (100.0, 0.6)]);
    let table = Table::new(&tf, CT);
    for (va, vb) in [(-900.0, -300.0), (-900.0, 50.0), (70.0, 2500.0), (-1000.0, 3000.0), (900.0, 1000.0)] {
        let ((colour, extinction), (c, e)) = (table.segment(va, vb), mean(&tf, va, vb));
        assert!((extinction - e).abs() < 1e-4 * e, "{va}..{vb}: {extinction} against {e}");
        assert!((colour - c).abs().max_element() < 1e-3, "{va}..{vb}: {colour} against {c}");
    }
}

#[test]
fn a_faint_tissue_beyond_an_opaque_one_keeps_its_digits() {
    // In prefix sums of f32 the bone's 7.6/mm over 3500 HU would leave the faint tissue with errors of
    // 1e-3/mm.
    let faint = 0.002;
    let tf = white(&[(-1000.0, 1.0), (2500.0, 1.0), (2500.0, faint), (3000.0, faint), (3000.0, 0.0)]);
    let table = Table::new(&tf, CT);
    let exact = extinction_of(faint);
    let mut worst = 0f64;
    for i in 0..400 {
        let va = 2510.0 + f64::from(i);
        worst = worst.max((table.segment(va, va + 1.0).1 - exact).abs());
    }
    assert!(worst < 8e-6, "mean extinction is {worst:e}/mm off");
}

#[test]
fn presets_have_tables_that_agree_with_them() {
    for preset in PRESETS {
        let tf = preset.over(CT);
        let table = Table::new(&tf, CT);
        assert!((4096..=65536).contains(&table.len()) && table.step <= 1.0, "{}", preset.name);
        let mut worst = 0f64;
        for i in 0..60 {
            let va = -1000.0 + 67.0 * f64::from(i);
            for width in [1.5, 7.0, 60.0, 700.0] {
                let (e, truth) = (table.segment(va, va + width).1, mean(&tf, va, va + width).1);
                worst = worst.max((e - truth).abs());
            }
        }
        assert!(worst < 2e-3, "{}: {worst}/mm off", preset.name);
    }
}

fn function() -> impl Strategy<Value = TransferFunction> {
    let intensity = prop_oneof![4 => -1024.0..3071.0, 1 => (-20i32..60).prop_map(|k| f64::from(k) * 50.0)];
    let opacity = prop_oneof![2 => Just(0.0), 1 => Just(1.0), 3 => 0.0..1.0, 3 => 0.0..0.05];
    let colours = prop::collection::vec((intensity.clone(), prop::array::uniform3(0.0..=1.0)), 1..6);
    let opacities = prop::collection::vec((intensity, opacity), 1..12);
    (colours, opacities).prop_map(|(c, o)| tf(&c, &o))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn segments_have_the_mean_of_the_function(tf in function(), va in -1100.0..3200.0f64, ln_width in 0.0..8.0f64) {
        let table = Table::new(&tf, CT);
        let vb = va + table.step * ln_width.exp();
        let (va, vb) = (va.clamp(CT[0], CT[1]), vb.clamp(CT[0], CT[1]));
        prop_assume!(vb - va >= table.step);
        let ((colour, extinction), (c, e)) = (table.segment(va, vb), mean(&tf, va, vb));
        // At both ends the sum is linear across an entry: at most an eighth of the entry's jump each, at
        // worst a full step of the function. And the sums are rounded.
        let entries = (vb - va) / table.step;
        let greatest = tf.opacities().iter().map(|p| extinction_of(p.opacity)).fold(0.0, f64::max);
        let bound = greatest / entries * 0.55 + 4.0 * table.integral_unit / entries + 1e-3 * e + 1e-4 * greatest;
        prop_assert!((extinction - e).abs() <= bound, "{} against {}, allowed {}", extinction, e, bound);
        prop_assert!(colour.cmpge(DVec3::ZERO).all() && colour.cmple(DVec3::ONE).all());
        // Colours of what can be seen: weighted by how opaque it is.
        let difference = (colour * extinction - c * e).abs().max_element();
        prop_assert!(difference <= bound, "colour: {} allowed {}", difference, bound);
    }

    #[test]
    fn whole_entries_are_integrated_to_the_last_digits(tf in function(), a in 0usize..4000, n in 1usize..3000) {
        let table = Table::new(&tf, CT);
        let (a, b) = (a.min(table.len() - 2), (a + n).min(table.len() - 1));
        let knots: Vec<f64> =
            [tf.extent(), CT].concat().into_iter().chain(tf.opacities().iter().map(|p| p.intensity)).collect();
        let at = |i: usize| table.first + i as f64 * table.step;
        // Midpoint sums between knots, 64 an entry.
        let mut cuts: Vec<f64> = knots.into_iter().filter(|&k| k > at(a) && k < at(b)).collect();
        cuts.push(at(b));
        cuts.sort_by(f64::total_cmp);
        let (mut sum, mut from) = (0.0, at(a));
        for to in cuts {
            let parts = (((to - from) / table.step).ceil().max(1.0) * 64.0) as usize;
            let width = (to - from) / parts as f64;
            sum += (0..parts).map(|i| tf.extinction(from + (i as f64 + 0.5) * width)).sum::<f64>() * width;
            from = to;
        }
        let truth = sum / (at(b) - at(a));
        let shown = table.segment(at(a), at(b)).1;
        let unit = table.integral_unit / (b - a) as f64;
        prop_assert!((shown - truth).abs() <= unit + 2e-4 * truth, "{shown} against {truth}");
    }

    #[test]
    fn tables_of_anything_are_sound(
        points in prop::collection::vec((prop_oneof![-1e3..1e3, -1e36..1e36, -1e-30..1e-30, Just(0.0)], 0.0..=1.0), 1..6),
        range in prop::array::uniform2(prop_oneof![any::<f64>(), -1e4..1e4]),
        va in any::<f64>(), vb in -1e4..1e4,
    ) {
        let table = Table::new(&white(&points), range);
        prop_assert!((4096..=Table::most_entries(range)).contains(&table.len()));
        prop_assert!(Table::most_entries(range) <= 65536);
        for i in [0, 1, table.len() / 2, table.len() - 1] {
            let v = table.first + i as f64 * table.step;
            prop_assert_eq!(f64::from(v as f32), v);
        }
        prop_assert!(table.integrals.windows(2).all(|w| (0..4).all(|c| w[0][c] <= w[1][c])));
        prop_assert!(table.points.iter().flatten().all(|x| x.is_finite() && *x >= 0.0));
        prop_assert!(table.point(va).1.is_finite());
        let (colour, extinction) = table.segment(if va.abs() < 1e30 { va } else { 0.0 }, vb);
        prop_assert!(colour.is_finite() && extinction.is_finite() && extinction >= 0.0);
    }
}
