//! Rows that no fit writes: unusable ones, opacities without bound, discs.

use super::*;

#[test]
fn unusable_splats_are_dropped_and_counted() {
    let poison: [(usize, f32); 7] = [
        (0, f32::NAN),
        (2, f32::INFINITY),
        (6, f32::NAN),
        (7, 1e3),
        (8, -1e3),
        (12, f32::NAN),
        (4, f32::NAN),
    ];
    let mut payload = little(&PLAIN_ROW);
    for (at, value) in poison {
        let mut row = PLAIN_ROW;
        row[at] = value;
        payload.extend(little(&row));
    }
    let mut zero_rotation = PLAIN_ROW;
    zero_rotation[10..].fill(0.0);
    payload.extend(little(&zero_rotation));
    payload.extend(little(&PLAIN_ROW));

    let file = file("binary_little_endian", &plain_header(&(poison.len() + 3).to_string()), &payload);
    let read = loaded(&file, &LENIENT).expect("it is read leniently");
    assert_eq!((read.set.splats.len(), read.mended.dropped), (2, poison.len() + 1));
    let error = loaded(&file, &STRICT).err().expect("it is refused strictly");
    assert_eq!(error.code, "VGS-PLY-022");
    assert!(error.message.contains("splat 1 "), "{error}");
}

#[test]
fn an_opaque_splat_of_8_bits_is_opaque() {
    // Programs that hold opacities as bytes write +∞ for 255, and −∞ for 0.
    let row = |logit: f32| {
        let mut row = PLAIN_ROW;
        row[6] = logit;
        little(&row)
    };
    let payload = [row(f32::INFINITY), row(f32::NEG_INFINITY), row(0.5)].concat();
    let read =
        loaded(&file("binary_little_endian", &plain_header("3"), &payload), &STRICT).expect("all three");
    let opacities: Vec<f32> = read.set.splats.iter().map(Activations::opacity).collect();
    assert!(opacities[0] > 0.999_999 && opacities[1] < 1e-6 && opacities[2] > 0.6, "{opacities:?}");
    assert_eq!(read.mended.dropped, 0);
}

#[test]
fn discs_of_2d_splatting_are_as_thin_as_a_splat_may_be() {
    let (names, row): (Vec<&str>, Vec<f32>) =
        PLAIN.iter().zip(PLAIN_ROW).filter(|(name, _)| **name != "scale_2").unzip();
    let header = format!("element vertex 1\n{}", declared("float", &names));
    let read = loaded(&file("binary_little_endian", &header, &little(&row)), &STRICT).expect("a disc");
    let [a, b, thin] = read.set.splats[0].log_scale;
    assert_eq!((a, b, read.layout, read.mended.widened), (-1.0, -2.0, "2dgs", 0));
    assert!((thin - (-1.0 - 1e4f32.ln())).abs() < 1e-5, "{thin}");
    let two: Vec<&str> = names.into_iter().filter(|name| *name != "scale_1").collect();
    let header = format!("element vertex 1\n{}", declared("float", &two));
    let error = loaded(&file("binary_little_endian", &header, &little(&row[1..])), &STRICT).err();
    assert_eq!(error.expect("one scale is none of a disc").code, "VGS-PLY-019");
}
