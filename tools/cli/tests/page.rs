//! `vgs convert` to a page, and `vgs page`: what is in a page, what is not, and who gets it.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::Child;
use std::sync::Arc;

use crate::support::{Folder, fit};
use engine::splat::{self, Grid, ReadOptions, SplatSet, vgs};
use engine::transfer::{FixedTo, Light};
use glam::DVec3;
use page::{Page, PartKind};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, ClientConnection, RootCertStore, StreamOwned};
use serde_json::Value;
use view::model::deletions::{Deletion, Target};
use view::model::orbit::Orbit;
use view::model::state::{Object, Plane, ViewState};

/// Edge of the phantom, voxels: so many that the splats of a fit are smaller than their field on voxels.
const SIZE: u32 = 40;

fn set(folder: &Folder, name: &str) -> SplatSet {
    splat::read(folder.path(name), &ReadOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn read(folder: &Folder, name: &str) -> Page {
    Page::read(&folder.path(name)).unwrap_or_else(|e| panic!("{name}: {e}")).0
}

/// The splats that a part holds.
fn splats_of(page: &Page, part: usize) -> SplatSet {
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    vgs::decode(&page.data[part], &strict).expect("splats").0
}

fn convert(folder: &Folder, arguments: &[&str]) -> Value {
    folder.run(&[&["convert"], arguments, &["--json"]].concat()).json()
}

/// A fit whose splats above the middle are a liver, and the others a spleen of the label 7.
fn labelled(folder: &Folder, name: &str) -> SplatSet {
    assert_eq!(folder.run(&fit("plain.ply", &["--no-eval"])).code, 0);
    let mut labelled = set(folder, "plain.ply");
    let mut heights: Vec<f32> = labelled.splats.iter().map(|splat| splat.mean[2]).collect();
    heights.sort_by(f32::total_cmp);
    let middle = heights[heights.len() / 2];
    let label = |height: f32| if height >= middle { 2 } else { 7 };
    labelled.labels = Some(labelled.splats.iter().map(|splat| label(splat.mean[2])).collect());
    labelled.label_names = vec![(2, "liver".to_owned()), (7, "spleen".to_owned())];
    labelled.label_region();
    splat::write(&folder.path(name), &labelled, false).expect("a file");
    labelled
}

#[test]
fn a_page_holds_the_file_as_it_is_and_no_name_of_it() {
    let folder = Folder::new(SIZE);
    assert_eq!(folder.run(&fit("Mueller.ply", &["--no-eval"])).code, 0);
    assert_eq!(folder.run(&["convert", "Mueller.ply", "-o", "Mueller.vgs"]).code, 0);
    let told = convert(&folder, &["Mueller.vgs", "-o", "a.html"]);
    let page = read(&folder, "a.html");
    assert!(page.data == [folder.read("Mueller.vgs")], "the file as it is");
    let html = folder.text("a.html");
    assert!(!html.contains("Mueller") && !html.contains(&*folder.path("").to_string_lossy()), "whose it is");
    assert_eq!((told["title"].as_str(), told["bytes"].as_u64()), (Some("Volume"), Some(html.len() as u64)));
    assert_eq!(told["data_bytes"], page.data[0].len());
    assert_eq!(told["parts"][0]["kind"], "vgs");
    let scene = &page.scene;
    assert_eq!((scene.unit.as_str(), scene.title.as_str()), ("hu", "Volume"));
    assert_eq!(scene.program, format!("vgs {}", env!("CARGO_PKG_VERSION")));
    assert_eq!((scene.parts[0].kind, &scene.parts[0].numbers[..]), (PartKind::Vgs, &[[0, 0]][..]));
    assert_eq!((scene.objects[0].number, scene.objects[0].name.as_str()), (0, "Volume"));
    let presets = engine::transfer::PRESETS.iter().filter(|preset| preset.unit == engine::unit::Unit::Hu);
    assert!(presets.map(|preset| preset.name).eq(scene.presets.iter().map(|preset| preset.name.as_str())));
    assert!(scene.presets.contains(&scene.function), "{}", scene.function.name);

    // Of a PLY it holds what a .vgs of it is.
    convert(&folder, &["Mueller.ply", "-o", "b.html"]);
    assert!(read(&folder, "b.html").data == page.data);
    // What other splats need is decoded for the page.
    let free = SplatSet { grid: None, form: splat::Form::Field, region: None, ..set(&folder, "Mueller.ply") };
    splat::write(&folder.path("free.ply"), &free, false).expect("a file");
    let told = convert(&folder, &["free.ply", "-o", "free.html"]);
    assert_eq!(told["parts"][0]["kind"], "voxels");
    assert!(read(&folder, "free.html").data[0].len() > 100);
}

#[test]
fn many_splats_travel_as_voxels() {
    let folder = Folder::new(16);
    let many = [
        "fit",
        "ct.nii.gz",
        "--roi",
        "mask.nii.gz",
        "-o",
        "a.vgs",
        "--splats",
        "600",
        "--iterations",
        "8",
        "--no-eval",
    ];
    assert_eq!(folder.run(&many).code, 0);
    let told = convert(&folder, &["a.vgs", "-o", "a.html"]);
    assert_eq!((&told["parts"][0]["kind"], &told["splats"]), (&"voxels".into(), &600.into()));
    let held = read(&folder, "a.html").data[0].len();
    assert!(held < folder.read("a.vgs").len(), "{held} bytes");
    assert_eq!(told["parts"][0]["numbers"], serde_json::json!([[0, 0]]));
}

#[test]
fn a_page_is_told_in_words_and_kept_unless_forced() {
    let folder = Folder::new(SIZE);
    assert_eq!(folder.run(&fit("bones.ply", &["--no-eval"])).code, 0);
    let title = "</script><!-- \"A\" & <b> @TITLE@";
    let ended = folder.run(&["convert", "bones.ply", "-o", "a.html", "--title", title]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    for word in ["of program and", "it names bones", "whoever has the file has the data", "sends nothing"] {
        assert!(ended.err.contains(word), "{word}: {}", ended.err);
    }
    assert_eq!(read(&folder, "a.html").scene.title, title);
    let html = folder.text("a.html");
    assert!(!html.contains("</script><!--") && !html.contains("<b>"), "it is text wherever it stands");
    let before = folder.contents();
    for (arguments, code) in
        [(&["bones.ply", "-o", "a.html"][..], 73), (&["bones.ply", "-o", "bones.ply", "--force"], 73)]
    {
        assert_eq!(folder.run(&[&["convert"], arguments].concat()).code, code);
    }
    assert!(folder.contents() == before);
    assert_eq!(folder.run(&["convert", "bones.ply", "-o", "a.html", "--force"]).code, 0);
    assert_eq!(read(&folder, "a.html").scene.title, "Bones");

    let told = folder.run(&["page", "a.html"]);
    assert!(told.code == 0 && told.out.contains("title               Bones"), "{}{}", told.out, told.err);
    let json = folder.run(&["page", "a.html", "--json"]).json();
    assert_eq!((json["title"].as_str(), json["objects"][0]["name"].as_str()), (Some("Bones"), Some("bones")));
    let cut = &html[..html.find("id=\"data-0\">").expect("the data") + 50];
    let changed = html.replace("\"unit\":\"hu\"", "\"unit\":\"hu\",\"more\":1");
    let place = html.find("id=\"data-0\">").expect("the data") + 1000;
    let other = if &html[place..=place] == "5" { "6" } else { "5" };
    let flipped = [&html[..place], other, &html[place + 1..]].concat();
    for (name, content, code) in [
        ("cut.html", cut, "VGS-PAGE-005"),
        ("changed.html", &changed, "VGS-PAGE-004"),
        ("flipped.html", &flipped, "VGS-PAGE-005"),
        ("other.html", "<!doctype html><p>Hello", "VGS-PAGE-003"),
    ] {
        folder.write(name, content);
        let ended = folder.run(&["page", name, "--serve"]);
        assert!(ended.code == 65 && ended.err.contains(code), "{name}: {}", ended.err);
    }
    assert_eq!(folder.run(&["page", "none.html"]).code, 66);
}

#[test]
fn files_are_parts_with_numbers_of_their_objects() {
    let folder = Folder::new(SIZE);
    assert_eq!(folder.run(&fit("Mueller.ply", &["--no-eval"])).code, 0);
    for name in ["bones.vgs", "Mueller.vgs"] {
        assert_eq!(folder.run(&["convert", "Mueller.ply", "-o", name]).code, 0);
    }
    labelled(&folder, "organs.ply");
    convert(
        &folder,
        &["bones.vgs", "organs.ply", "Mueller.vgs", "-o", "a.html", "--object", "bones:opacity=0.3"],
    );
    let page = read(&folder, "a.html");
    let numbers: Vec<_> = page.scene.parts.iter().map(|part| part.numbers.clone()).collect();
    assert_eq!(numbers, [vec![[0, 1]], vec![[2, 2], [7, 3]], vec![[0, 4]]]);
    let objects = page.scene.objects.iter().map(|object| (object.number, object.name.as_str()));
    assert!(objects.eq([(1, "bones"), (2, "liver"), (3, "spleen"), (4, "Object 4")]));
    assert!(page.data[0] == folder.read("bones.vgs") && page.data[2] == folder.read("Mueller.vgs"));
    assert_eq!(splats_of(&page, 1).label_names.len(), 2);
    assert_eq!((page.scene.objects[0].opacity, page.scene.objects[1].opacity), (0.3, 1.0));
    assert!(
        page.scene.objects.iter().all(|object| object.tint.is_some() && object.function.is_some()),
        "as usual"
    );
    assert!(!folder.text("a.html").contains("Mueller"));
    // One of them alone keeps its number, its colour and its file.
    convert(&folder, &["bones.vgs", "organs.ply", "-o", "b.html", "--object", "organs/spleen"]);
    let page = read(&folder, "b.html");
    assert_eq!((page.scene.parts.len(), page.scene.objects.len()), (1, 1));
    assert_eq!(page.scene.objects[0].number, 3);
    assert!(splats_of(&page, 0).labels.expect("labels").iter().all(|&label| label == 7));
    convert(&folder, &["bones.vgs", "organs.ply", "-o", "c.html", "--object", "bones"]);
    assert!(read(&folder, "c.html").data == [folder.read("bones.vgs")]);
}

#[test]
fn what_is_not_selected_is_not_in_the_page() {
    let folder = Folder::new(SIZE);
    let ours = labelled(&folder, "ours.ply");
    let of = |label: u8| ours.labels.iter().flatten().filter(|&&own| own == label).count();
    let told = convert(&folder, &["ours.ply", "-o", "liver.html", "--object", "liver"]);
    assert_eq!((&told["splats"], &told["left_out"]), (&of(2).into(), &of(7).into()));
    let page = read(&folder, "liver.html");
    let found = splats_of(&page, 0);
    assert_eq!((found.splats.len(), found.label_names.len()), (of(2), 1));
    assert!(!folder.text("liver.html").contains("spleen"), "nor is its name");

    let place = |i: usize| ours.splats[i].mean.map(f64::from);
    let [x, y, z] = place(0);
    let corners = format!("--box={},{},{},{},{},{}", x - 4.0, y - 4.0, z - 4.0, x + 4.0, y + 4.0, z + 4.0);
    let inside = |i: &usize| (0..3).all(|k| (place(*i)[k] - [x, y, z][k]).abs() <= 4.0);
    let inside = (0..ours.splats.len()).filter(inside).count();
    convert(&folder, &["ours.ply", "-o", "box.html", &corners]);
    assert_eq!(splats_of(&read(&folder, "box.html"), 0).splats.len(), inside);
    let ended = folder.run(&["convert", "ours.ply", "-o", "no.html", "--box", "900,900,900,901,901,901"]);
    assert!(ended.code == 3 && ended.err.contains("VGS-CLI-131"), "{}", ended.err);

    // Planes can be moved and objects shown again, so that these are all there; and that is told.
    let ended =
        folder.run(&["convert", "ours.ply", "-o", "all.html", "--object", "7:hidden", "--clip", "x<1"]);
    assert!(ended.code == 0 && ended.err.contains("with what is hidden or cut away"), "{}", ended.err);
    let page = read(&folder, "all.html");
    assert_eq!(splats_of(&page, 0).splats.len(), ours.splats.len());
    let plane = page.scene.clip[0];
    assert_eq!((plane.normal, plane.offset), ([1.0, 0.0, 0.0], 1.0));
    assert!(page.scene.objects.iter().map(|object| object.visible).eq([true, false]));
}

#[test]
fn a_session_is_shown_as_the_window_showed_it() {
    let folder = Folder::new(SIZE);
    let ours = labelled(&folder, "Mueller.ply");
    let function = engine::transfer::load("CT-Muscle", [-1000.0, 3000.0]).expect("a preset");
    let mut state = ViewState::new(&function);
    state.files.splats = vec![folder.path("Mueller.ply")];
    let row = |label, name: &str| Object::new(0, Some(label), name);
    state.objects = vec![
        Object { tint: Some(DVec3::Y), opacity: 0.5, ..row(2, "liver") },
        Object { visible: false, ..row(7, "spleen") },
    ];
    state.background = DVec3::new(0.25, 0.5, 1.0);
    state.light = Light { fixed_to: FixedTo::Patient, towards: [0.0, 2.0, 0.0], fill: 0.25 };
    state.orbit = Orbit { azimuth_deg: 90.0, pivot_mm: DVec3::new(1.0, 2.0, 3.0), ..state.orbit };
    state.clip.planes.push(Plane { on: true, normal: DVec3::NEG_X, offset_mm: -7.0 });
    state.clip.planes.push(Plane { on: false, normal: DVec3::Y, offset_mm: 0.0 });
    state.write(folder.path("s.toml"), false).expect("a session");
    convert(&folder, &["s.toml", "-o", "a.html"]);
    let Page { scene, data } = read(&folder, "a.html");
    assert_eq!(splats_of(&Page { scene: scene.clone(), data }, 0).splats.len(), ours.splats.len());
    assert_eq!(scene.function.name, "CT-Muscle");
    assert_eq!((scene.objects[0].tint, scene.objects[0].opacity), (Some([0.0, 1.0, 0.0]), 0.5));
    assert_eq!((scene.objects[0].visible, scene.objects[1].visible), (true, false));
    assert_eq!(scene.background, [0.25, 0.5, 1.0]);
    assert_eq!((scene.light.direction, scene.light.fill), ([0.0, 1.0, 0.0], 0.25));
    assert_eq!(scene.clip.len(), 1, "the other is off");
    assert_eq!((scene.camera.target, scene.camera.up), ([1.0, 2.0, 3.0], [0.0, 0.0, 1.0]));
    let eye = DVec3::from_array(scene.camera.eye) - DVec3::from_array(scene.camera.target);
    assert!(eye.normalize().distance(DVec3::NEG_X) < 1e-9, "from the left: {eye}");
    // Flags come before the session, and what is deleted is not in the page.
    state.deleted = vec![Deletion::Object(Target { file: 0, label: Some(7) })];
    state.write(folder.path("s.toml"), true).expect("a session");
    convert(
        &folder,
        &["s.toml", "-o", "b.html", "--camera", "right", "--background", "white", "--title", "Mine"],
    );
    let page = read(&folder, "b.html");
    assert_eq!((page.scene.title.as_str(), page.scene.background), ("Mine", [1.0; 3]));
    assert!(page.scene.camera.eye[0] > 10.0, "from the right");
    assert!(splats_of(&page, 0).labels.expect("labels").iter().all(|&label| label == 2));
    let html = folder.text("b.html");
    assert!(!html.contains("spleen") && !html.contains("Mueller"));
}

#[test]
fn what_cannot_be_a_page_is_told() {
    let folder = Folder::new(SIZE);
    let ours = labelled(&folder, "ours.ply");
    assert_eq!(folder.run(&["convert", "ours.ply", "-o", "colours.spz"]).code, 0);
    let moved = Grid { size: [SIZE + 1; 3], ..ours.grid.expect("a grid") };
    let other = SplatSet { grid: Some(moved), ..ours };
    splat::write(&folder.path("other.ply"), &other, false).expect("a file");
    ViewState::new(&engine::transfer::load("CT-Bone", [-1000.0, 3000.0]).expect("a preset"))
        .write(folder.path("s.toml"), false)
        .expect("a session");
    for (arguments, code, exit) in [
        (&["colours.spz", "-o", "no.html"][..], "VGS-PAGE-001", 65),
        (&["ours.ply", "other.ply", "-o", "no.html"], "VGS-SPLAT-003", 65),
        (&["ours.ply", "ours.ply", "-o", "no.ply"], "VGS-CLI-161", 2),
        (&["ours.ply", "-o", "no.ply", "--title", "A"], "VGS-CLI-162", 2),
        (&["ours.ply", "-o", "no.vgs", "--camera", "left"], "VGS-CLI-162", 2),
        (&["ours.ply", "s.toml", "-o", "no.html"], "VGS-CLI-159", 2),
        (&["s.toml", "-o", "no.html"], "VGS-CLI-135", 2),
        (&["ours.ply", "ours.ply", "-o", "no.html", "--like", "ours.ply"], "VGS-CLI-160", 2),
        (&["ours.ply", "-o", "no.html", "--background", "transparent"], "VGS-CLI-163", 2),
        (&["ours.ply", "-o", "no.html", "--camera", "above"], "VGS-CAM-002", 2),
        (
            &[
                "ours.ply",
                "-o",
                "no.html",
                "--clip",
                "box:0,0,0,1,1,1",
                "--clip",
                "x<0",
                "--clip",
                "y<0",
                "--clip",
                "z<0",
            ],
            "VGS-PAGE-002",
            2,
        ),
    ] {
        let ended = folder.run(&[&["convert"], arguments].concat());
        assert_eq!(ended.code, exit, "{arguments:?}: {}", ended.err);
        assert!(ended.err.contains(code), "{arguments:?}: {}", ended.err);
    }
    assert!(["no.html", "no.ply", "no.vgs"].iter().all(|name| !folder.path(name).exists()));
}

/// A server of `a.html`, which ends with this value.
struct Server {
    child: Child,
    /// Port that it has taken.
    port: u16,
}

impl Server {
    fn start(folder: &Folder, more: &[&str]) -> Self {
        let mut child =
            folder.start(&[&["page", "a.html", "--serve", "--port", "0", "--json"], more].concat());
        let mut line = String::new();
        let mut out = BufReader::new(child.stdout.take().expect("a pipe"));
        out.read_line(&mut line).expect("text");
        let json: Value = serde_json::from_str(&line).unwrap_or_else(|e| panic!("{e}: {line}"));
        Server { child, port: json["port"].as_u64().expect("a port") as u16 }
    }

    /// Sends a request, and returns the head and the body of the answer.
    fn ask(&self, request: &str) -> (String, Vec<u8>) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("a server");
        stream.write_all(request.as_bytes()).expect("sent");
        answer(&mut stream)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended by itself, where a test has failed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn answer(stream: &mut impl Read) -> (String, Vec<u8>) {
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).expect("an answer");
    let end = bytes.windows(4).position(|end| end == b"\r\n\r\n").expect("a head") + 4;
    (String::from_utf8(bytes[..end].to_vec()).expect("text"), bytes[end..].to_vec())
}

fn get(host: &str) -> String {
    format!("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n")
}

/// A folder with a page, `a.html`.
fn folder_with_page() -> Folder {
    let folder = Folder::new(SIZE);
    assert_eq!(folder.run(&fit("bones.ply", &["--no-eval"])).code, 0);
    convert(&folder, &["bones.ply", "-o", "a.html"]);
    folder
}

#[test]
fn a_page_is_served_to_this_machine_and_nothing_else_is() {
    let folder = folder_with_page();
    let server = Server::start(&folder, &[]);
    let (head, body) = server.ask(&get(&format!("localhost:{}", server.port)));
    assert!(head.starts_with("HTTP/1.1 200") && body == folder.read("a.html"), "{head}");
    let length = format!("Content-Length: {}\r\n", body.len());
    assert!(head.contains(&length) && head.contains("no-store"), "{head}");
    let (same, nothing) = server.ask(&get("127.0.0.1").replace("GET", "HEAD"));
    assert!(same == head && nothing.is_empty());
    let statuses: BTreeSet<String> = [
        get("evil.example"),
        get("localhost").replace("GET /", "GET /bones.ply"),
        get("localhost").replace("GET", "DELETE"),
        "nonsense\r\n\r\n".to_owned(),
        format!("GET / HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n\r\n", "a".repeat(20_000)),
    ]
    .iter()
    .map(|request| server.ask(request).0[9..12].to_owned())
    .collect();
    assert_eq!(statuses, ["400", "404", "405", "421", "431"].map(str::to_owned).into());
    // Many at once are answered, one way or the other, and it goes on.
    let idle: Vec<_> =
        (0..40).map(|_| TcpStream::connect(("127.0.0.1", server.port)).expect("a server")).collect();
    drop(idle);
    let mut asked = 0;
    while !server.ask(&get("localhost")).0.starts_with("HTTP/1.1 200") {
        asked += 1;
        assert!(asked < 100, "it answers no more");
    }
    let taken = folder.run(&["page", "a.html", "--serve", "--port", &server.port.to_string()]);
    assert!(taken.code == 74 && taken.err.contains("VGS-PAGE-010"), "{}", taken.err);
}

#[test]
fn other_machines_need_a_certificate() {
    let folder = folder_with_page();
    folder.write("cert.pem", CERTIFICATE);
    folder.write("key.pem", KEY);
    for (more, code, word) in [
        (&["--address", "0.0.0.0"][..], 2, "VGS-PAGE-009"),
        (&["--cert", "key.pem", "--key", "key.pem"], 65, "VGS-PAGE-006"),
        (&["--cert", "cert.pem", "--key", "cert.pem"], 65, "VGS-PAGE-007"),
        (&["--cert", "none.pem", "--key", "key.pem"], 66, "none.pem"),
        (&["--cert", "cert.pem"], 2, "--key"),
    ] {
        let ended = folder.run(&[&["page", "a.html", "--serve"], more].concat());
        assert!(ended.code == code && ended.err.contains(word), "{more:?}: {}", ended.err);
    }
    let server = Server::start(&folder, &["--address", "0.0.0.0", "--cert", "cert.pem", "--key", "key.pem"]);
    let mut known = RootCertStore::empty();
    known.add(CertificateDer::from_pem_slice(CERTIFICATE.as_bytes()).expect("PEM")).expect("a certificate");
    let config = ClientConfig::builder_with_provider(Arc::new(rustls::crypto::ring::default_provider()))
        .with_safe_default_protocol_versions()
        .expect("versions")
        .with_root_certificates(known)
        .with_no_client_auth();
    let name = ServerName::try_from("localhost").expect("a name");
    let client = ClientConnection::new(Arc::new(config), name).expect("a client");
    let connection = TcpStream::connect(("127.0.0.1", server.port)).expect("a server");
    let mut stream = StreamOwned::new(client, connection);
    stream.write_all(get("a-name-of-the-house").as_bytes()).expect("sent");
    let (head, body) = answer(&mut stream);
    assert!(head.starts_with("HTTP/1.1 200") && body == folder.read("a.html"), "{head}");
}

/// Certificate of `localhost` that signs itself, for these tests alone.
const CERTIFICATE: &str = "\
-----BEGIN CERTIFICATE-----
MIIBZTCCAQqgAwIBAgIBATAKBggqhkjOPQQDAjAUMRIwEAYDVQQDDAlsb2NhbGhv
c3QwIBcNMjAwMTAxMDAwMDAwWhgPMjEyMDAxMDEwMDAwMDBaMBQxEjAQBgNVBAMM
CWxvY2FsaG9zdDBZMBMGByqGSM49AgEGCCqGSM49AwEHA0IABEuQPiwNQWqLMMnC
ak+ylgR7pBbHV8bocHm3g77cOOTTppSO9pkHZvYjvxCaU0p4KppVuKL3MO64Uy3n
PhYudNmjSzBJMBoGA1UdEQQTMBGCCWxvY2FsaG9zdIcEfwAAATAMBgNVHRMBAf8E
AjAAMB0GA1UdDgQWBBSI97/9Ms2nkwKuwh/jlFFbeMnhnjAKBggqhkjOPQQDAgNJ
ADBGAiEAngpn+XdSUL4oawO6BriouhQRRE9ThcRYHidJOdfBkckCIQDN/NPEvOtj
hvMzAlECZe294AMZiNZ2fuNJzLhuxXLJZA==
-----END CERTIFICATE-----
";
const KEY: &str = "\
-----BEGIN PRIVATE KEY-----
MIGHAgEAMBMGByqGSM49AgEGCCqGSM49AwEHBG0wawIBAQQgZJR7wZ+fQylCqrDP
XN1daUxcMKKUW1b5diDBOQg/dwChRANCAARLkD4sDUFqizDJwmpPspYEe6QWx1fG
6HB5t4O+3Djk06aUjvaZB2b2I78QmlNKeCqaVbii9zDuuFMt5z4WLnTZ
-----END PRIVATE KEY-----
";
