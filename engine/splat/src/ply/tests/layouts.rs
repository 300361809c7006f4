//! Layouts other than that of today, and what other programs leave of it.

use super::*;

#[test]
fn rows_of_62_floats_have_nothing_more_and_give_the_set_back() {
    let set =
        SplatSet { region: Some(region_of(&[([3, 2, 1], 4)])), labels: Some((0..9).collect()), ..sample(9) };
    let file = encoded_as(&set, Row::Fixed);
    let header = header_of(&file);
    let lines: Vec<&str> = header.lines().collect();
    // Programs that count the lines `property float` of the whole file must come to 62 as well.
    let floats: Vec<&str> = lines.iter().filter_map(|line| line.strip_prefix("property float ")).collect();
    assert_eq!((lines[2], floats.len()), ("element vertex 9", 62));
    assert_eq!(
        [floats[8], floats[9], floats[53], floats[54]],
        ["f_dc_2", "f_rest_0", "f_rest_44", "opacity"]
    );
    let tail = "element splat_intensity 9\nproperty double intensity\nproperty uchar label\n";
    assert!(header.contains(tail), "{header}");
    let row = |i: usize, k: usize| {
        let at = header.len() + i * 248 + 4 * k;
        f32::from_le_bytes(file[at..at + 4].try_into().expect("four bytes"))
    };
    let expected = &set.splats[8];
    assert_eq!(
        [row(8, 0), row(8, 54), row(8, 55), row(8, 58)],
        [expected.mean[0], expected.opacity_logit, expected.log_scale[0], expected.rotation[0],]
    );
    let read = loaded(&file, &STRICT).expect("our own file");
    let region = read.header.element("region").expect("the region").1.count;
    assert_eq!(file.len(), header.len() + 9 * (62 * 4 + 8 + 1) + region);
    assert_eq!((read.set, read.layout), (set, "inria"));
}

/// Written by version 0.2.0 before the intensity was a property of the vertices: `vgs fit` of two balls with
/// labels in an oblique grid.
const SECOND_ELEMENT: &[u8] = include_bytes!("second-element.ply");

#[test]
fn files_with_a_second_element_are_read_as_before() {
    let Loaded { set, layout, .. } = loaded(SECOND_ELEMENT, &STRICT).expect("an earlier file of ours");
    assert_eq!((set.splats.len(), layout, set.field.kernel), (40, "vgs", Kernel::Compact));
    assert_eq!(set.origin_mm, DVec3::new(137.0, -207.0, -797.0), "as the file has it");
    // Numbers of the file, by another reader.
    let first = &set.splats[0];
    assert_eq!(first.mean, [2.0603073, -1.4126235, -3.353494]);
    assert_eq!((first.intensity, set.splats[39].intensity), (-581.626, 121.88739));
    assert_eq!(
        set.label_counts().iter().map(|l| (l.label, l.splats)).collect::<Vec<_>>(),
        [(3, 24), (7, 16)]
    );
    assert_eq!((set.form, set.iterations), (Form::Grid, Some(60)));
    let region = set.region.as_ref().expect("found from its splats and exceptions");
    let of = |number| region.voxels().filter(|(_, object)| object.number == number).count();
    assert_eq!([of(3), of(7)], [889, 485]);
    let again = loaded(&encoded(&set), &STRICT).expect("the layout of today").set;
    assert_eq!(again, set, "nothing is lost on the way to the layout of today");
}

#[test]
fn what_splat_transform_leaves_of_a_file_has_places_intensities_and_labels() {
    // It keeps the columns of the vertices and drops comments and further elements.
    let set = SplatSet {
        origin_mm: DVec3::ZERO,
        region: Some(region_of(&[([3, 2, 1], 4)])),
        labels: Some((0..9).collect()),
        ..sample(9)
    };
    let file = encoded(&set);
    let header = header_of(&file);
    let kept: Vec<&str> = header
        .lines()
        .take_while(|line| !line.starts_with("element region"))
        .filter(|line| !line.starts_with("comment"))
        .collect();
    let bare = [kept.join("\n").as_bytes(), b"\nend_header\n", &file[header.len()..][..9 * 19 * 4]].concat();
    let Loaded { set: read, layout, .. } = loaded(&bare, &STRICT).expect("without comments");
    assert_eq!((&read.splats, &read.labels, read.origin_mm), (&set.splats, &set.labels, set.origin_mm));
    assert!(read.unit.is_physical() && layout == "3dgs");
    assert_eq!((read.field.kernel, read.grid, &read.region), (Kernel::Gaussian, None, &None));
    let given_back = read.with_statements_of(&set);
    assert_eq!(given_back, set);
}
