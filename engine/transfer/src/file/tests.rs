//! Files as other programs write them, files that nobody should write, and what users type.

use glam::DVec3;
use proptest::prelude::*;

use super::entry::{MAX_POINTS, opacity_points};
use super::formats::{MAX_BYTES, parse};
use super::*;
use crate::{ColourPoint, Material, TransferFunction, WINDOW_OPACITY, preset, window_level};
use base::error::{Kind, Result};

const CT: [f64; 2] = [-1024.0, 3071.0];

const XML: &str = r#"<?xml version="1.0" encoding="utf-8"?>
<MRML>
  <Camera name="not this one"/>
  <VolumeProperty name="Vessels &amp; bone" gradientOpacity="4 0 1 255 1" specularPower="12" specular="0.3" shade="1"
    ambient="0.15" diffuse="0.8" scalarOpacity="6 -3024 0 150 0.25 3071 0.75"
    colorTransfer="8 -3024 0 0 0 3071 1 0.5 0.25" interpolation="1"/>
  <VolumeProperty name="Broken" scalarOpacity="4 0 0 1" colorTransfer="4 0 1 1 1"/>
  <VolumeProperty name="Steep" shade="0" scalarOpacity="8 -100 0 0 0 0 1 100 1" colorTransfer="4 0 1 1 1"
    gradientOpacity="4 0 0 50 1"></VolumeProperty>
</MRML>
"#;

const VP: &str =
    "1\n1\n0.9\n0.1\n0.2\n10\n6 -3024 0 -16.5 0 641.5 0.75\n4 0 1 255 1\n8 -3024 0 0 0 641.5 1 0.5 0.25\n";

const VP_JSON: &str = r#"{
    "@schema": "https://raw.githubusercontent.com/slicer/slicer/main/Modules/Loadable/VolumeRendering/Resources/Schema/volume-property-schema-v1.0.0.json#",
    "volumeProperties": [{
        "effectiveRange": [0.0, 220.0], "isoSurfaceValues": [0.0], "interpolationType": "linear",
        "components": [{
            "shade": true, "componentWeight": 1.0,
            "lighting": { "diffuse": 1.0, "ambient": 0.2, "specular": 0.0, "specularPower": 1.0 },
            "scalarOpacityUnitDistance": 1.0,
            "rgbTransferFunction": { "type": "colorTransferFunction", "points": [
                { "x": 0.0, "color": [0.0, 0.0, 0.0], "midpoint": 0.5, "sharpness": 0.0 },
                { "x": 220.0, "color": [1.0, 0.5, 0.25], "midpoint": 0.5, "sharpness": 0.0 } ] },
            "scalarOpacity": { "type": "piecewiseLinearFunction", "points": [
                { "x": 0.0, "y": 0.0 }, { "x": 40.0, "y": 0.19 }, { "x": 40.0, "y": 0.36 }, { "x": 220.0, "y": 0.36 } ] }
        }]
    }]
}"#;

const PARAVIEW: &str = r#"[
  { "Name": "Ramp", "ColorSpace": "RGB", "NanColor": [1, 1, 0], "RGBPoints": [0, 0, 0, 1, 1, 1, 0, 0],
    "Points": [0, 0, 0.5, 0, 1, 0.8, 0.5, 0] },
  { "Name": "Cool", "ColorSpace": "Diverging", "RGBPoints": [-5, 0.23, 0.299, 0.754, 5, 0.706, 0.016, 0.15] },
  { "Name": "Half", "RGBPoints": [0, 0, 0] },
  { "Name": "Steps", "ColorSpace": "Step", "RGBPoints": [0, 1, 0, 0, 10, 0, 1, 0, 20, 0, 0, 1],
    "Points": [0, 1, 0.5, 0] }
]"#;

fn one(text: &str, name: Option<&str>) -> Result<TransferFunction> {
    parse(text, name).map(|(_, tf)| tf)
}

fn near(a: DVec3, b: [f64; 3]) -> bool {
    (a - DVec3::from_array(b)).abs().max_element() < 1e-9
}

#[test]
fn slicer_presets() {
    let first = one(XML, None).unwrap();
    assert_eq!(first.name, "Vessels & bone");
    let material =
        Material { shade: true, ambient: 0.15, diffuse: 0.8, specular: 0.3, power: 12.0, occlusion: 0.0 };
    assert_eq!(first.material, material);
    assert!(near(first.at(3071.0).0, [1.0, 0.5, 0.25]) && first.at(150.0).1 == 0.25);
    assert!(!first.depends_on_gradient() && first.gradient_opacities().len() == 2);
    let steep = one(XML, Some("steep")).unwrap();
    assert_eq!((steep.at(-1e-9).1, steep.at(0.0).1), (0.0, 1.0));
    assert!(steep.depends_on_gradient() && !steep.material.shade);
    // A broken one does not spoil its neighbours, and says what is wrong when it is asked for.
    let error = one(XML, Some("Broken")).unwrap_err();
    assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-TF-008"));
    assert!(
        error.message.contains("\"Broken\": scalarOpacity: 4 numbers announced, 3 found"),
        "{}",
        error.message
    );
    let error = one(XML, Some("CT-AAA")).unwrap_err();
    assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-TF-009"));
    assert_eq!(error.help, "it has Vessels & bone, Broken, Steep");
}

#[test]
fn slicer_volume_property() {
    let tf = one(VP, None).unwrap();
    assert_eq!(
        tf.material,
        Material { shade: true, ambient: 0.1, diffuse: 0.9, specular: 0.2, power: 10.0, occlusion: 0.0 }
    );
    assert_eq!((tf.at(641.5).1, tf.at(312.5).1), (0.75, 0.375));
    assert!(near(tf.at(9999.0).0, [1.0, 0.5, 0.25]));
    // With the explanations of Slicer's manual, lines from Windows, and nothing where Slicer has a default.
    let odd = VP.replace('\n', " => what it is\r\n");
    assert_eq!(one(&odd, None).unwrap(), tf);
    let bare = "1\n\n\n\n\n\n2 0 0.5\n\n4 0 1 1 1\n";
    assert_eq!(one(bare, None).unwrap().material, Material::default());
    assert_eq!(one(VP, Some("x")).unwrap_err().code, "VGS-TF-009");
}

#[test]
fn slicer_volume_property_json() {
    let tf = one(VP_JSON, None).unwrap();
    assert_eq!(
        tf.material,
        Material { shade: true, ambient: 0.2, diffuse: 1.0, specular: 0.0, power: 1.0, occlusion: 0.0 }
    );
    assert!(near(tf.at(110.0).0, [0.5, 0.25, 0.125]));
    assert!((tf.at(20.0).1 - 0.095).abs() < 1e-12 && tf.at(40.0).1 == 0.36 && tf.at(39.999).1 < 0.191);
    // The same opacities per 2 mm: 1 − √(1 − α), between control points too.
    let per_2_mm = one(&VP_JSON.replace("UnitDistance\": 1.0", "UnitDistance\": 2.0"), None).unwrap();
    for v in [7.0, 20.0, 33.0, 40.0, 100.0] {
        let expected = 1.0 - (1.0 - tf.at(v).1).sqrt();
        assert!((per_2_mm.at(v).1 - expected).abs() < 1e-5, "{v}");
    }
    assert!((per_2_mm.at(40.0).1 - 0.2).abs() < 1e-12);
    assert!((per_2_mm.extinction(100.0) - tf.extinction(100.0) / 2.0).abs() < 1e-12);
    // A midpoint and a sharp step.
    let bent = VP_JSON.replace("\"y\": 0.0 }", "\"y\": 0.0, \"midpoint\": 0.25, \"sharpness\": 1.0 }");
    let bent = one(&bent, None).unwrap();
    assert_eq!((bent.at(9.99).1, bent.at(10.0).1), (0.0, 0.19));
    // Grey where there is no colour.
    let grey = VP_JSON.replace("\"rgbTransferFunction\"", "\"other\"").replace(
        "\"shade\"",
        "\"grayTransferFunction\": {\"points\": [{\"x\": 0, \"y\": 0}, {\"x\": 1, \"y\": 1}]}, \"shade\"",
    );
    assert!(near(one(&grey, None).unwrap().at(0.5).0, [0.5; 3]));
}

#[test]
fn paraview_colour_maps() {
    let ramp = one(PARAVIEW, None).unwrap();
    assert!(near(ramp.at(0.25).0, [0.25, 0.0, 0.75]) && (ramp.at(0.5).1 - 0.4).abs() < 1e-12);
    let cool = one(PARAVIEW, Some("cool")).unwrap();
    assert!((cool.at(0.0).0 - DVec3::splat(0.865)).abs().max_element() < 5e-3);
    assert_eq!((cool.at(-5.0).1, cool.at(0.0).1, cool.at(5.0).1), (0.0, 0.5, 1.0));
    let steps = one(PARAVIEW, Some("Steps")).unwrap();
    assert!(near(steps.at(-0.1).0, [1.0, 0.0, 0.0]) && near(steps.at(9.9).0, [0.0, 1.0, 0.0]));
    assert!(near(steps.at(10.1).0, [0.0, 0.0, 1.0]) && near(steps.at(30.0).0, [0.0, 0.0, 1.0]));
    let error = one(PARAVIEW, Some("Half")).unwrap_err();
    assert!(error.message.contains("map 3 \"Half\": RGBPoints has 3 numbers"), "{}", error.message);
    // A single map without the array, after a byte order mark.
    let single = format!("\u{feff}{}", r#"{"Name": "S", "RGBPoints": [0, 0, 0, 0, 1, 1, 1, 1]}"#);
    assert_eq!(one(&single, None).unwrap().name, "S");
}

#[test]
fn hues_go_along_the_numbers_unless_the_map_wraps_them() {
    let map = |more: &str| {
        let text = format!(
            r#"[{{"Name": "R", "ColorSpace": "HSV"{more}, "RGBPoints": [0, 0, 0, 1, 8, 1, 0, 0], "Points": [0, 1, 0.5, 0, 8, 1, 0.5, 0]}}]"#
        );
        one(&text, None)
    };
    for (more, expected) in [
        ("", [0.0, 1.0, 0.0]),
        (r#", "HSVWrap": 0"#, [0.0, 1.0, 0.0]),
        (r#", "HSVWrap": 1"#, [1.0, 0.0, 1.0]),
        (r#", "HSVWrap": true"#, [1.0, 0.0, 1.0]),
    ] {
        assert!(near(map(more).unwrap().at(4.0).0, expected), "{more}");
    }
    let error = map(r#", "HSVWrap": "yes""#).unwrap_err();
    assert!(error.code == "VGS-TF-008" && error.message.contains("HSVWrap is \"yes\""), "{error}");
    // The map that the splats of faults/paraview-hsv are to be shown with.
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/faults/paraview-hsv/map.json");
    if !std::path::Path::new(path).exists() {
        println!("SKIPPED: ../shared/faults/paraview-hsv is not there");
        return;
    }
    assert!(near(load(path, CT).unwrap().at(150.0).0, [0.0, 1.0, 0.0]));
}

#[test]
fn what_is_wrong_is_told() {
    let json = |from: &str, to: &str| VP_JSON.replace(from, to);
    for (text, code, says) in [
        (String::new(), "VGS-TF-007", "empty"),
        ("hello".to_owned(), "VGS-TF-007", "known format"),
        ("{\"a\": 1}".to_owned(), "VGS-TF-007", "known format"),
        ("<MRML></MRML>".to_owned(), "VGS-TF-008", "without a transfer function"),
        (XML.replace("</MRML>", "</WRONG>"), "VGS-TF-008", "line 10: not well-formed XML"),
        (XML.replace("&amp;", "&bomb;"), "VGS-TF-008", "attribute name"),
        (XML.replace("6 -3024 0", "6 -3024,5 0"), "VGS-TF-008", "number 1 is \"-3024,5\""),
        (XML.replace("6 -3024 0", "99999999999999999999 0"), "VGS-TF-008", "number of numbers"),
        (XML.replace("6 -3024 0", "4000000000 0"), "VGS-TF-008", "at most 32768 can be used"),
        (XML.replace("6 -3024 0", "6 nan 0"), "VGS-TF-001", "its intensity is NaN"),
        (XML.replace("150 0.25", "150 1.25"), "VGS-TF-001", "1.25 is not between 0 and 1"),
        (XML.replace("ambient=\"0.15\"", "ambient=\"-1\""), "VGS-TF-003", "ambient"),
        (XML.replace("colorTransfer=\"8 ", "colour=\"8 "), "VGS-TF-008", "no attribute colorTransfer"),
        (
            VP.replace("6 -3024 0", "5 -3024 0"),
            "VGS-TF-008",
            "line 7 (scalar opacity): 5 numbers announced, more found",
        ),
        ("1\n1\n0.9\n".to_owned(), "VGS-TF-008", "line 7 (scalar opacity) is missing"),
        (VP.replace("0.9", "0,9"), "VGS-TF-008", "line 3 (diffuse) is \"0,9\""),
        (json("\"shade\": true", "\"shade\": 3"), "VGS-TF-008", "line 6 column"),
        (json("\"x\": 40.0", "\"x\": 1e999"), "VGS-TF-008", "out of range"),
        (json("property-schema-v1", "property-schema-v2"), "VGS-TF-008", "of the schema"),
        (json("UnitDistance\": 1.0", "UnitDistance\": 0.0"), "VGS-TF-008", "scalarOpacityUnitDistance is 0"),
        (
            json("\"scalarOpacity\"", "\"else\""),
            "VGS-TF-008",
            "volumeProperties[0]: there is no scalarOpacity",
        ),
        (json("\"rgbTransferFunction\"", "\"else\""), "VGS-TF-008", "no rgbTransferFunction"),
        (json("\"components\"", "\"else\""), "VGS-TF-008", "no components"),
        (json("0.36 }", "1.36 }"), "VGS-TF-001", "point 3: 1.36"),
        (json("[0.0, 0.0, 0.0]", "[0.0, 0.0]"), "VGS-TF-008", "column"),
        (PARAVIEW.replace("1, 1, 0, 0]", "1, 2, 0, 0]"), "VGS-TF-008", "colour 2 is not between 0 and 1"),
        (PARAVIEW.replace("\"RGB\"", "\"CMYK\""), "VGS-TF-008", "ColorSpace is \"CMYK\""),
        (format!("[\"RGBPoints\",{}", "[".repeat(100_000)), "VGS-TF-008", "recursion limit"),
    ] {
        let error = one(&text, None).unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::BadData, code), "{}", error.message);
        assert!(error.message.contains(says), "{:?} does not say {says:?}", error.message);
    }
    let many = "{\"x\":0,\"y\":0},".repeat(MAX_POINTS + 1);
    let many = json("{ \"x\": 0.0, \"y\": 0.0 },", &many);
    assert!(one(&many, None).unwrap_err().message.contains("16388 points"));
}

#[test]
fn files_and_names_that_users_type() {
    let dir = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| {
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (xml, vp, colours) = (
        put("presets.xml", XML.as_bytes()),
        put("My Bone.VP", VP.as_bytes()),
        put("a:b.json", PARAVIEW.as_bytes()),
    );
    assert_eq!(load("ct-bone", CT).unwrap(), preset("CT-Bone").unwrap().over(CT));
    assert_eq!(load("grey", [0.0, 50.0]).unwrap().extent(), [0.0, 50.0]);
    assert_eq!(load(&xml, CT).unwrap().name, "Vessels & bone");
    assert_eq!(load(&format!("{xml}:Steep"), CT).unwrap().name, "Steep");
    assert_eq!(load(&vp, CT).unwrap().name, "My Bone", "a file without a name lends its own");
    // Shares of the range are stretched over the data, and only those.
    assert_eq!(load(&colours, CT).unwrap().extent(), CT);
    assert_eq!(load(&colours, [0.0, 1.0]).unwrap().extent(), [0.0, 1.0]);
    assert_eq!(load(&format!("{colours}:Cool"), CT).unwrap().extent(), [-5.0, 5.0]);
    assert_eq!(load("window:400,40", CT).unwrap(), window_level(400.0, 40.0, WINDOW_OPACITY).unwrap());
    assert_eq!(load("window:400, 40, 0.3", CT).unwrap().at(1000.0).1, 0.3);
    assert_eq!(load("window:Lung", CT).unwrap().extent(), [-1350.0, 150.0]);
    let latin = put("latin.vp", b"1\n1\n\xe9");
    let large = put("large.vp", &vec![b'1'; MAX_BYTES as usize + 1]);
    for (spec, kind, code) in [
        ("CT-Bones", Kind::Usage, "VGS-TF-006"),
        ("", Kind::Usage, "VGS-TF-006"),
        ("none/such.xml:CT-AAA", Kind::Missing, "VGS-TF-006"),
        ("such.vp.json", Kind::Missing, "VGS-TF-006"),
        ("window:heart", Kind::Usage, "VGS-TF-005"),
        ("window:1,2,3,4", Kind::Usage, "VGS-TF-005"),
        ("window:0,40", Kind::Usage, "VGS-TF-005"),
        (&format!("{xml}:Nope"), Kind::Usage, "VGS-TF-009"),
        (&latin, Kind::BadData, "VGS-TF-008"),
        (&large, Kind::BadData, "VGS-TF-010"),
        (dir.path().to_str().unwrap(), Kind::BadData, "VGS-IO-002"),
    ] {
        let error = load(spec, CT).unwrap_err();
        assert_eq!((error.kind, error.code), (kind, code), "{spec}: {error}");
        if code == "VGS-TF-006" {
            assert!(
                error.help.contains("CT-Skin")
                    && error.help.contains("window:")
                    && error.help.contains(".vp.json")
            );
        }
    }
}

#[test]
fn only_vp_json_is_written_and_nothing_is_overwritten() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let tf = preset("CT-Angio").unwrap().over(CT);
    for name in ["a.vp", "a.xml", "a.json", "a", "a.vp.json.txt"] {
        let error = save(&tf, path(name), true).unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-TF-011"), "{name}");
        assert!(error.help.ends_with(".vp.json"));
    }
    save(&tf, path("a.VP.json"), false).unwrap();
    assert_eq!(save(&tf, path("a.VP.json"), false).unwrap_err().code, "VGS-OUT-001");
    save(&tf, path("a.VP.json"), true).unwrap();
    assert_eq!(read(path("a.VP.json"), Some("CT-Angio"), CT).unwrap(), tf);
}

#[test]
fn what_is_written_follows_slicers_schema() {
    let points = opacity_points(&[(0.0, 0.0), (0.0, 0.5), (100.0, 0.5), (100.0, 0.0)]);
    let colours = vec![ColourPoint { intensity: 0.0, colour: DVec3::new(0.1, 0.2, 0.3) }];
    let tf = TransferFunction::new("two steps", colours, points, Material::default()).unwrap();
    let json: serde_json::Value = serde_json::from_str(&vp_json::write(&tf)).unwrap();
    assert!(json["@schema"].as_str().unwrap().ends_with("/volume-property-schema-v1.0.0.json#"));
    let property = &json["volumeProperties"][0];
    assert_eq!(property["interpolationType"], "linear");
    assert_eq!(property["effectiveRange"], serde_json::json!([0.0, 100.0]));
    let component = &property["components"][0];
    for key in ["ambient", "diffuse", "specular", "specularPower"] {
        assert!(component["lighting"][key].is_number(), "{key}");
    }
    // A key of ours, which is there only where it says something.
    assert!(component["lighting"].get("ambientOcclusion").is_none());
    assert_eq!(component["rgbTransferFunction"]["type"], "colorTransferFunction");
    assert_eq!(component["scalarOpacity"]["type"], "piecewiseLinearFunction");
    assert!(component.get("gradientOpacity").is_none());
    // The schema asks for all four, and VTK keeps one point only where two have the same x.
    let points = component["scalarOpacity"]["points"].as_array().unwrap();
    let xs: Vec<f64> = points.iter().map(|p| p["x"].as_f64().unwrap()).collect();
    assert!(points.iter().all(|p| p["y"].is_number() && p["midpoint"] == 0.5 && p["sharpness"] == 0.0));
    assert!(xs.len() == 4 && xs.windows(2).all(|w| w[0] < w[1]), "{xs:?}");
}

fn function() -> impl Strategy<Value = TransferFunction> {
    let x = prop_oneof![3 => -3024.0..3071.0, 1 => (-3i32..4).prop_map(f64::from), 1 => -1e30..1e30];
    let opacities = prop::collection::vec((x.clone(), 0.0..=1.0), 1..12);
    let gradients = prop::collection::vec((x.clone(), 0.0..=1.0), 0..4);
    let colours = prop::collection::vec((x, prop::array::uniform3(0.0..=1.0)), 1..12);
    let material = (any::<bool>(), prop::array::uniform4(0.0..50.0), prop_oneof![Just(0.0), 0.0..=1.0]);
    (".{0,20}", colours, opacities, gradients, material).prop_map(
        |(name, colours, opacities, gradients, m)| {
            let colours = colours
                .into_iter()
                .map(|(intensity, c)| ColourPoint { intensity, colour: DVec3::from(c) })
                .collect();
            let [ambient, diffuse, specular, power] = m.1;
            let material = Material { shade: m.0, ambient, diffuse, specular, power, occlusion: m.2 };
            TransferFunction::new(name, colours, opacity_points(&opacities), material)
                .and_then(|tf| tf.with_gradient_opacity(opacity_points(&gradients)))
                .unwrap()
        },
    )
}

proptest! {
    #[test]
    fn what_is_written_is_read_back_equal(tf in function()) {
        prop_assert_eq!(one(&vp_json::write(&tf), None).unwrap(), tf);
    }

    #[test]
    fn any_bytes_give_an_error_or_a_function(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        if let Ok(text) = std::str::from_utf8(&bytes) {
            let _ = one(text, None);
        }
        let _ = one(&String::from_utf8_lossy(&bytes), Some("x"));
    }

    #[test]
    fn damaged_files_give_an_error_or_a_sound_function(
        which in 0usize..4, at in any::<prop::sample::Index>(), cut in 0usize..40, put in "[-0-9.,eE:\"{}<>/ \\[\\]a-z]{0,6}",
    ) {
        let text = [XML, VP, VP_JSON, PARAVIEW][which];
        let start = at.index(text.len());
        let damaged = format!("{}{put}{}", &text[..start], &text[(start + cut).min(text.len())..]);
        if let Ok(tf) = one(&damaged, None) {
            let (colour, opacity) = tf.at(100.0);
            prop_assert!((0.0..=1.0).contains(&opacity) && colour.is_finite() && tf.extinction(100.0).is_finite());
        }
    }

    #[test]
    fn any_spec_is_an_error_or_a_function(spec in "\\PC{0,40}") {
        let _ = load(&spec, CT);
        let _ = load(&format!("window:{spec}"), CT);
    }
}
