//! Sets with colours: spherical harmonics of ordinary 3D Gaussian splatting.

use super::*;
use crate::Harmonics;
use base::unit::Unit;

/// Returns a file of the usual layout (normals, harmonics between f_dc and opacity) with `rest` properties
/// `f_rest`, whose value in row `i` is `value(i, index)`.
fn usual(count: usize, rest: usize, value: impl Fn(usize, usize) -> f32) -> Vec<u8> {
    let names: Vec<String> = (0..rest).map(|i| format!("f_rest_{i}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let names = [&PLAIN[..3], &["nx", "ny", "nz"], &PLAIN[3..6], &names, &PLAIN[6..]].concat();
    let header = format!("element vertex {count}\n{}", declared("float", &names));
    let payload: Vec<f32> = (0..count)
        .flat_map(|i| {
            let mut row = PLAIN_ROW.to_vec();
            row[3..6].copy_from_slice(&[0.1, 0.2, 0.3 + i as f32]);
            row.splice(6..6, (0..rest).map(|index| value(i, index)));
            row.splice(3..3, [9.0; 3]);
            row
        })
        .collect();
    file("binary_little_endian", &header, &little(&payload))
}

#[test]
fn harmonics_are_kept_whole() {
    for (degree, rest) in [(0, 0), (1, 9), (2, 24), (3, 45)] {
        // Row, channel and coefficient in one number.
        let per_channel = rest / 3;
        let value = |i: usize, index: usize| {
            (1000 * i + 100 * (index / per_channel.max(1)) + 1 + index % per_channel.max(1)) as f32
        };
        let set = loaded(&usual(3, rest, value), &STRICT).expect("a usual file").set;
        let colours = set.colours.as_ref().expect("it has colours");
        assert_eq!((colours.degree, colours.stride()), (degree, rest + 3));
        assert_eq!((set.unit.is_physical(), set.field.kernel), (false, Kernel::Gaussian));
        assert_eq!(set.splats[0].rotation, [1.0, 0.0, 0.0, 0.25], "the columns behind are not mixed up");
        for i in 0..3 {
            let of = colours.of(i);
            assert_eq!(of[..3], [0.1, 0.2, 0.3 + i as f32]);
            for (k, rgb) in of.chunks(3).enumerate().skip(1) {
                let expected = [0, 100, 200].map(|channel| (1000 * i + channel + k) as f32);
                assert_eq!(rgb, expected, "coefficient {k} of splat {i} at degree {degree}");
            }
        }
        // Written and read again, with labels too.
        for labels in [None, Some(vec![1, 0, 9])] {
            let set = SplatSet { labels, ..set.clone() };
            let again = loaded(&encoded(&set), &STRICT).expect("our own file");
            assert_eq!(again.set, set);
            assert_eq!(again.header.elements.len(), 1, "no element for the luminance");
            let labels = usize::from(set.labels.is_some());
            assert_eq!(again.header.elements[0].properties.len(), 17 + rest + labels, "nor a property");
            // In rows of 62 floats the degree is the highest, with zeros.
            let fixed = loaded(&encoded_as(&set, Row::Fixed), &STRICT).expect("our own file").set;
            let colours = fixed.colours.as_ref().expect("colours");
            assert_eq!((colours.degree, &fixed.labels), (3, &set.labels));
            let given = set.colours.as_ref().expect("colours");
            for i in 0..3 {
                let (kept, zeros) = colours.of(i).split_at(given.stride());
                assert_eq!(kept, given.of(i));
                assert!(zeros.iter().all(|&c| c == 0.0));
            }
        }
    }
}

#[test]
fn the_colour_of_a_file_is_the_colour_that_is_seen() {
    // Red 0.5 + SH0 · 0.1 from everywhere, and brighter along -x by its fourth coefficient (f_rest_2).
    let file = usual(1, 9, |_, index| if index == 2 { 1.0 } else { 0.0 });
    let colours = loaded(&file, &STRICT).expect("a usual file").set.colours.expect("colours");
    let seen = |direction| colours.colour(0, direction);
    let sh0 = f64::from(SH0);
    for (direction, red) in
        [([1.0, 0.0, 0.0], -0.488_602_5), ([-1.0, 0.0, 0.0], 0.488_602_5), ([0.0, 1.0, 0.0], 0.0)]
    {
        let expected = [0.5 + 0.1 * sh0 + red, 0.5 + 0.2 * sh0, 0.5 + 0.3 * sh0];
        for (got, want) in seen(direction).into_iter().zip(expected) {
            assert!((got - want).abs() < 1e-6, "{direction:?}: {got}, not {want}");
        }
    }
}

#[test]
fn beside_an_intensity_colours_are_ignored() {
    let header = format!("{}property float intensity\nproperty float f_rest_0\n", plain_header("1"));
    let payload = [little(&PLAIN_ROW), little(&[77.0, f32::NAN])].concat();
    let set = loaded(&file("binary_little_endian", &header, &payload), &STRICT).expect("with intensity").set;
    assert!(set.unit.is_physical() && set.colours.is_none());
    assert!(loaded(&encoded(&sample(2)), &STRICT).expect("ours").set.colours.is_none());
}

#[test]
fn harmonics_that_are_incomplete_or_not_finite() {
    let code = |file: &[u8]| loaded(file, &LENIENT).err().expect("it is refused").code;
    for rest in [1, 8, 10, 44, 46, 72] {
        assert_eq!(code(&usual(1, rest, |_, _| 0.0)), "VGS-PLY-024", "{rest}");
    }
    // Nine of them, with a gap.
    let mut names: Vec<String> = PLAIN.map(str::to_owned).to_vec();
    names.extend((0..10).filter(|&i| i != 4).map(|i| format!("f_rest_{i}")));
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let header = format!("element vertex 1\n{}", declared("float", &names));
    let gap = file("binary_little_endian", &header, &little(&[1.0; 23]));
    let error = loaded(&gap, &LENIENT).err().expect("a gap");
    assert!(error.code == "VGS-PLY-024" && error.message.contains("`f_rest_4`"), "{error}");

    // A splat with a coefficient that is no number goes, with its colours and its label.
    let poison = usual(4, 24, |i, index| if i == 1 && index == 20 { f32::NAN } else { i as f32 });
    let read = loaded(&poison, &LENIENT).expect("leniently");
    assert_eq!((read.set.splats.len(), read.mended.dropped), (3, 1));
    let colours = read.set.colours.expect("colours");
    let last = |i: usize| colours.of(i)[26];
    assert_eq!((colours.coefficients.len(), [last(0), last(1), last(2)]), (3 * 27, [0.0, 2.0, 3.0]));
    assert_eq!(loaded(&poison, &STRICT).err().expect("strictly").code, "VGS-PLY-022");
}

#[test]
fn colours_that_cannot_be_written() {
    let grey = |degree, coefficients| SplatSet {
        unit: Unit::Luminance,
        colours: Some(Harmonics { degree, coefficients }),
        ..sample(2)
    };
    check(&grey(0, vec![0.0; 6])).expect("one colour for each");
    for (set, word) in [
        (SplatSet { unit: Unit::Hu, ..grey(0, vec![0.0; 6]) }, "physical"),
        (grey(4, vec![0.0; 150]), "degree"),
        (grey(1, vec![0.0; 6]), "every splat"),
        (grey(0, vec![f32::NAN; 6]), "finite"),
    ] {
        let error = check(&set).expect_err(word);
        assert!(error.code == "VGS-PLY-012" && error.message.contains(word), "{error}");
    }
}
