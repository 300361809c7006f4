//! A page: one HTML file with the program, the scene as JSON and the data as text.

use std::path::Path;

use engine::render::{Look, PLANES};
use engine::splat::{ReadOptions, SplatSet, vgs};
use engine::transfer::PRESETS;
use engine::{Error, Kind, Result, output};

use crate::content::Content;
use crate::scene::{Function, Part, PartKind, Plane, Scene, SceneLight, SceneObject, Viewpoint};
use crate::{names, text, voxels};

/// The program of every page: HTML, style and scripts in one file, made of `web/`.
const PROGRAM: &str = include_str!("../bundle/page.html");
/// Where the scene and the data stand in it.
const SCENE_HERE: &str = "<!--scene-->";
/// Where its title stands.
const TITLE_HERE: &str = "@TITLE@";
/// Elements of the scene and of the data, with the number of the part between the last two.
const SCENE: &str = "<script type=\"application/json\" id=\"scene\">";
const DATA: [&str; 2] = ["<script type=\"text/plain\" id=\"data-", "\">"];
const END: &str = "</script>";
/// Most bytes of a page that is read: more than any browser opens.
const MOST_BYTES: u64 = 1 << 30;

/// How a scene is shown at first.
#[derive(Clone, Debug)]
pub struct Shown<'a> {
    /// Title; `None` for one that the objects name.
    pub title: Option<&'a str>,
    /// Functions, light, planes, and how objects look.
    pub look: &'a Look,
    /// Where it is seen from.
    pub viewpoint: Viewpoint,
    /// Background, display-referred, 0 to 1.
    pub background: [f64; 3],
}

/// A scene with its data.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// What it shows.
    pub scene: Scene,
    /// Data of each part of the scene.
    pub data: Vec<Vec<u8>>,
}

/// Sizes of a page that was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Bytes of the file.
    pub page: u64,
    /// Bytes of the program in it.
    pub program: u64,
    /// Bytes of the data before they became text.
    pub data: u64,
}

impl Page {
    /// Creates the page of some splats, which are all in `set`.
    ///
    /// # Errors
    /// [`Kind::Usage`] if there are more clip planes than a page can show.
    pub fn new(content: Content, set: &SplatSet, shown: &Shown<'_>) -> Result<Self> {
        let look = shown.look;
        if look.clip.len() > PLANES {
            let message = format!("{} clip planes, and a page shows {PLANES}", look.clip.len());
            return Err(Error::new(Kind::Usage, "VGS-PAGE-002", message).help("a box takes six planes"));
        }
        let objects = content.objects.into_iter().map(|(number, name)| {
            let own = look.objects.get(&number).copied().unwrap_or_default();
            SceneObject {
                number,
                name,
                visible: own.visible,
                tint: own.tint,
                opacity: own.opacity,
                function: look.functions.get(&number).map(Function::from),
            }
        });
        let objects: Vec<_> = objects.collect();
        let named: Vec<_> = objects.iter().map(|object| object.name.as_str()).collect();
        let range = set.intensity_range().unwrap_or([0.0, 1.0]);
        let presets = PRESETS.iter().filter(|preset| preset.unit == set.unit);
        let scene = Scene {
            program: concat!("vgs ", env!("CARGO_PKG_VERSION")).to_owned(),
            title: names::title(shown.title, &named),
            unit: set.unit.name().to_owned(),
            parts: content.parts,
            objects,
            function: Function::from(&look.transfer),
            presets: presets.map(|preset| Function::from(&preset.over(range))).collect(),
            light: SceneLight::from(&look.light),
            clip: look.clip.iter().map(Plane::from).collect(),
            camera: shown.viewpoint,
            background: shown.background,
        };
        Ok(Page { scene, data: content.data })
    }

    /// Returns the HTML.
    pub fn html(&self) -> String {
        // The title comes first, since it is escaped; an object may be called like the place of the title.
        let program = PROGRAM.replace(TITLE_HERE, &escaped(&self.scene.title));
        let (before, after) = program.split_once(SCENE_HERE).unwrap_or((&program, ""));
        let mut html =
            String::with_capacity(program.len() + self.data.iter().map(Vec::len).sum::<usize>() * 5 / 4);
        html.push_str(before);
        html.push_str(SCENE);
        // Numbers that are finite and strings can always be written.
        let json = serde_json::to_string(&self.scene).unwrap_or_default();
        html.push_str(&json.replace('<', "\\u003c"));
        html.push_str(END);
        for (i, data) in self.data.iter().enumerate() {
            html.push_str(&format!("\n{}{i}{}{}{END}", DATA[0], DATA[1], text::encode(data)));
        }
        html.push_str(after);
        html
    }

    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// Returns the errors of [`output::write_atomic`].
    pub fn write(&self, path: &Path, force: bool) -> Result<Sizes> {
        let html = self.html();
        output::write_atomic(path, force, |out| out.write_all(html.as_bytes()))?;
        Ok(self.sizes(&html))
    }

    /// Reads a file, and refuses what is no page of this program.
    ///
    /// # Errors
    /// [`Kind::Missing`] or [`Kind::Io`] if it cannot be read, [`Kind::BadData`] if it is no page.
    pub fn read(path: &Path) -> Result<(Self, String)> {
        use std::io::Read;
        let failed = |error| Error::io(path, "reading a page", &error);
        let mut bytes = Vec::new();
        let file = engine::input::open(path).map_err(failed)?;
        file.take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
        let help = "a page is written by `vgs convert SPLATS -o scene.html`";
        let not_one = || Error::new(Kind::BadData, "VGS-PAGE-003", "no page of vgs").file(path).help(help);
        let html = String::from_utf8(bytes).ok().filter(|html| html.len() as u64 <= MOST_BYTES);
        let html = html.ok_or_else(not_one)?;
        let json = element(&html, SCENE).ok_or_else(not_one)?;
        let scene: Scene = serde_json::from_str(json).map_err(|error| {
            let message = format!("a page whose scene cannot be read: {error}");
            Error::new(Kind::BadData, "VGS-PAGE-004", message)
                .file(path)
                .help("it was changed, or is of another version; write it again from its splats")
        })?;
        let data = scene.parts.iter().enumerate().map(|(i, part)| {
            let start = format!("{}{i}{}", DATA[0], DATA[1]);
            let text = element(&html, &start)?;
            text::decode(text, usize::try_from(part.bytes).ok()?)
        });
        let data = data.collect::<Option<Vec<_>>>().ok_or_else(|| not_whole().file(path))?;
        Ok((Page { scene, data }, html))
    }

    /// Fails if a browser would find the data damaged.
    ///
    /// # Errors
    /// [`Kind::BadData`] if there are none, or if they are not as they were written.
    pub fn check(&self) -> Result<()> {
        let strict = ReadOptions { strict: true, ..ReadOptions::default() };
        let is_sound = |(part, data): (&Part, &Vec<u8>)| match part.kind {
            PartKind::Vgs => vgs::decode(data, &strict).is_ok(),
            PartKind::Voxels => voxels::is_whole(data),
        };
        let sound = !self.data.is_empty() && self.scene.parts.iter().zip(&self.data).all(is_sound);
        if sound { Ok(()) } else { Err(not_whole()) }
    }

    /// Returns the sizes of a page with this HTML.
    pub fn sizes(&self, html: &str) -> Sizes {
        Sizes {
            page: html.len() as u64,
            program: PROGRAM.len() as u64,
            data: self.data.iter().map(|data| data.len() as u64).sum(),
        }
    }
}

fn not_whole() -> Error {
    Error::new(
        Kind::BadData,
        "VGS-PAGE-005",
        "a page whose data are not all there, or not as they were written",
    )
    .help("it was cut off or changed on its way; get it again, or write it again from its splats")
}

/// Returns what an element holds that begins so.
fn element<'a>(html: &'a str, start: &str) -> Option<&'a str> {
    html.split_once(start)?.1.split_once(END).map(|(inner, _)| inner)
}

/// Returns text as it stands between elements of HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use engine::render::ClipPlane;
    use engine::splat::Splat;
    use engine::unit::Unit;
    use glam::DVec3;

    use std::collections::BTreeSet;

    use super::*;

    fn content() -> Content {
        let data = vec![b"first".to_vec(), (0..=255).collect()];
        let part = |(i, data): (u8, &Vec<u8>)| Part {
            kind: PartKind::Vgs,
            bytes: data.len() as u64,
            numbers: vec![[0, i + 1]],
        };
        let parts = (0..).zip(&data).map(part).collect();
        Content { objects: vec![(1, "a <b>".to_owned()), (2, "@TITLE@<!--scene-->".to_owned())], parts, data }
    }

    fn set(unit: Unit) -> SplatSet {
        let splat = |intensity| Splat { intensity, ..Splat::default() };
        SplatSet { splats: vec![splat(100.0), splat(300.0)], unit, ..SplatSet::default() }
    }

    fn page(unit: Unit, title: &str, planes: usize) -> Result<Page> {
        let transfer = engine::transfer::load("CT-Bone", [0.0, 1.0]).expect("a preset");
        let clip = vec![ClipPlane { normal: DVec3::X, offset: 2.5 }; planes];
        let look = Look { clip, ..Look::new(transfer) };
        let viewpoint =
            Viewpoint::from_side("anterior", [DVec3::ZERO, DVec3::ONE], 30.0, 1.0).expect("a side");
        let shown = Shown { title: Some(title), look: &look, viewpoint, background: [0.0; 3] };
        Page::new(content(), &set(unit), &shown)
    }

    #[test]
    fn the_program_has_its_places() {
        assert_eq!(PROGRAM.matches(SCENE_HERE).count(), 1);
        assert!(PROGRAM.contains(TITLE_HERE) && PROGRAM.trim_end().ends_with("</html>"), "it is whole");
    }

    #[test]
    fn a_page_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.html");
        for title in
            ["Hip", "</title></script><script id=\"scene\">alert(1)</script>", "a & b @TITLE@ <!--scene-->"]
        {
            let page = page(Unit::Hu, title, 1).expect("a page");
            let sizes = page.write(&path, true).expect("written");
            let (read, html) = Page::read(&path).expect("a page");
            assert_eq!(read, page);
            assert_eq!((read.scene.title.as_str(), sizes.data), (title, 261));
            assert_eq!((sizes.page, sizes.program), (html.len() as u64, PROGRAM.len() as u64));
            // Nothing of a name is markup.
            assert_eq!(html.matches("alert(1)</script>").count() + html.matches("a <b>").count(), 0);
            assert_eq!(html.matches("id=\"scene\"").count(), PROGRAM.matches("id=\"scene\"").count() + 1);
        }
        assert_eq!(
            page(Unit::Hu, "", 1).expect("a page").write(&path, false).expect_err("there").code,
            "VGS-OUT-001"
        );
    }

    #[test]
    fn presets_are_those_of_the_unit_over_the_range() {
        let names = |unit| {
            let scene = page(unit, "", 0).expect("a page").scene;
            scene.presets.into_iter().map(|preset| preset.name).collect::<Vec<_>>()
        };
        let of = |unit| {
            PRESETS.iter().filter(move |preset| preset.unit == unit).map(|preset| preset.name.to_owned())
        };
        assert!(names(Unit::Hu).into_iter().eq(of(Unit::Hu)));
        let scene = page(Unit::Arbitrary, "", 0).expect("a page").scene;
        assert!(names(Unit::Arbitrary).into_iter().eq(of(Unit::Arbitrary)) && scene.unit == "arbitrary");
        let ends = scene.presets[0].opacities.iter().map(|point| point[0]);
        assert!(ends.clone().all(|v| (100.0..=300.0).contains(&v)), "{:?}", ends.collect::<Vec<_>>());
    }

    #[test]
    fn more_planes_than_a_page_shows_are_refused() {
        assert!(page(Unit::Hu, "", PLANES).is_ok());
        assert_eq!(page(Unit::Hu, "", PLANES + 1).expect_err("too many").code, "VGS-PAGE-002");
    }

    #[test]
    fn names_in_the_json_are_those_of_the_script() {
        let json = serde_json::to_value(page(Unit::Hu, "A", 1).expect("a page").scene).expect("JSON");
        let keys = |value: &serde_json::Value| {
            // Their order is that of the fields or of the alphabet, as features of other crates have it.
            let sorted: BTreeSet<_> = value.as_object().expect("an object").keys().cloned().collect();
            sorted.into_iter().collect::<Vec<_>>().join(" ")
        };
        assert_eq!(
            keys(&json),
            "background camera clip function light objects parts presets program title unit"
        );
        assert_eq!(keys(&json["function"]), "colours gradientOpacities material name opacities");
        assert_eq!(keys(&json["function"]["material"]), "ambient diffuse occlusion power shade specular");
        assert_eq!(keys(&json["objects"][0]), "function name number opacity tint visible");
        assert_eq!(keys(&json["camera"]), "eye fieldOfView target up");
        assert_eq!(keys(&json["light"]), "direction fill fixedTo");
        assert_eq!(keys(&json["clip"][0]), "normal offset");
        assert_eq!(keys(&json["parts"][0]), "bytes kind numbers");
        assert_eq!((&json["parts"][0]["kind"], &json["light"]["fixedTo"]), (&"vgs".into(), &"camera".into()));
    }
}
