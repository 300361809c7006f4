//! State of the viewer as plain data: the session file.
//!
//! Renderers ask for the parts in the engine's terms ([`ViewState::look`], [`Orbit::camera`],
//! [`Clip::planes`]). Nothing here knows windows, panels or the device.

use std::path::Path;

use engine::error::{Error, Kind, Result};
use engine::render::{
    Appearance, ClipPlane, DecodeOptions, FieldBudget, Look, OF_VOLUMES, ObjectChange, PLANES,
};
use engine::splat;
use engine::transfer::{Light, TransferFunction};
use engine::volume::edges::Edges;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::error_colours::ErrorColours;
use super::files::Files;
use super::in_headset::InHeadset;
use super::splat_mode::SplatMode;
use super::unpacked::{Unpacked, is_packed};
use crate::model::deletions::Deletion;
use crate::model::orbit::Orbit;
use crate::model::transfer::Transfer;

/// Version of the session file; later versions are refused.
pub const VERSION: u32 = 1;
/// Greatest number of clip planes beside the six of the crop box.
pub const MOST_PLANES: usize = PLANES - 6;
/// Size of the largest session file that is read, bytes.
const MAX_BYTES: u64 = 4 << 20;

/// Returns true if a file is a session: one by its name, or a zip of one and its files.
pub fn is_session(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("toml")) || is_packed(path)
}

/// Everything that a session file restores.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewState {
    /// [`VERSION`] of the program that wrote it.
    pub version: u32,
    /// Subject that is shown if there are both.
    #[serde(default)]
    pub shown: Subject,
    /// Mode in which splats are rendered.
    #[serde(default)]
    pub mode: SplatMode,
    /// Place at which the picture is split, a fraction of its width ([`ViewState::subjects`] says what is at
    /// either side of it). `None` if it is not split.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub split: Option<f64>,
    /// Edges of binary regions.
    #[serde(default, skip_serializing_if = "is_first")]
    pub edges: Edges,
    /// Most bytes of the device's memory for the decoded field; `None` for as many as it takes. Not in a session: it is of
    /// the machine.
    #[serde(skip)]
    pub field_memory: Option<u64>,
    /// Background: red, green, blue from 0 to 1.
    #[serde(default)]
    pub background: DVec3,
    /// Files of the data.
    #[serde(default)]
    pub files: Files,
    /// The camera.
    #[serde(default)]
    pub orbit: Orbit,
    /// Cameras that were kept.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bookmarks: Vec<Bookmark>,
    /// Quality and speed of pictures.
    #[serde(default)]
    pub quality: Quality,
    /// Annotations and panels that are shown.
    #[serde(default)]
    pub show: Show,
    /// Colours of the error against the volume.
    #[serde(default, skip_serializing_if = "ErrorColours::is_default")]
    pub errors: ErrorColours,
    /// Slices beside the picture.
    #[serde(default, skip_serializing_if = "Slices::is_default")]
    pub slices: Slices,
    /// Clip planes and crop box.
    #[serde(default)]
    pub clip: Clip,
    /// Light of surfaces.
    #[serde(default, skip_serializing_if = "is_first")]
    pub light: Light,
    /// Transfer function: from intensity to colour and opacity.
    pub transfer: Transfer,
    /// Fits and labels, in the order of the list.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub objects: Vec<Object>,
    /// Distances that were measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub distances: Vec<Distance>,
    /// Splats that are deleted, in the order in which they were.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub deleted: Vec<Deletion>,
    /// Where a headset shows the patient; `None` for where it does at first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub headset: Option<InHeadset>,
}

/// A camera that was kept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bookmark {
    /// Name for people.
    pub name: String,
    /// The camera.
    pub orbit: Orbit,
}

/// Subject of the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Subject {
    /// The splats.
    #[default]
    Splats,
    /// The splats that are compared with them.
    Beside,
    /// The volume, ray-marched.
    Volume,
}

impl Subject {
    /// All subjects, in the order in which one steps through them.
    pub const ALL: [Subject; 3] = [Subject::Splats, Subject::Beside, Subject::Volume];
    /// Those that are splats.
    pub const SETS: [Subject; 2] = [Subject::Splats, Subject::Beside];
}

/// Row of the list of objects: a fit, or one label of a fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Object {
    /// Index of its file in [`Files::splats`].
    pub file: usize,
    /// Label, if the fit has labels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub label: Option<u8>,
    /// Name for people.
    pub name: String,
    /// True if it is shown.
    pub visible: bool,
    /// Colour of its own, display-referred from 0 to 1; `None` for that of the transfer function.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tint: Option<DVec3>,
    /// Factor on the opacity per mm, 0 to 1.
    pub opacity: f64,
    /// Transfer function of its own, which mode decoded shows; `None` for that of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transfer: Option<Transfer>,
}

/// Clip planes and crop box.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Clip {
    /// Clip planes, at most [`MOST_PLANES`].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub planes: Vec<Plane>,
    /// Crop box; `None` until it is asked for the first time.
    #[serde(rename = "box", skip_serializing_if = "Option::is_none")]
    pub crop: Option<CropBox>,
}

/// Clip plane, which cuts away what has normal · x < offset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// True if it cuts.
    pub on: bool,
    /// Unit vector towards what stays, RAS.
    pub normal: DVec3,
    /// Offset of the plane, mm RAS.
    pub offset_mm: f64,
}

/// Box outside of which everything is cut away.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CropBox {
    /// True if it cuts.
    pub on: bool,
    /// Corner at the patient's left, back and feet, mm RAS.
    pub low_mm: DVec3,
    /// The opposite corner, mm RAS.
    pub high_mm: DVec3,
}

/// Quality and speed of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Quality {
    /// Distance of slabs in standard deviations of the middle splat, or of the samples of a volume or of decoded
    /// splats in voxel edges; `None` for what is usual in the mode.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<f64>,
    /// Greatest number of splats that are drawn; `None` for all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub splat_budget: Option<u64>,
    /// Time that a frame may take while the picture moves, ms.
    pub target_frame_ms: f64,
    /// True if the quality is lowered while the picture moves to meet the target; at rest it is full again.
    pub adaptive: bool,
}

/// Annotations and panels that are shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Show {
    /// True if the panels are shown.
    pub panels: bool,
    /// True if frame times, passes and memory are shown.
    pub overlay: bool,
    /// True if the letters of the patient's sides are shown.
    pub orientation: bool,
    /// True if the scale bar is shown.
    pub scale_bar: bool,
    /// True if the bar of the transfer function's colours is shown.
    pub colour_bar: bool,
    /// True if the cube with the patient's sides is shown.
    pub cube: bool,
    /// True if the handles of clip planes and of the crop box are shown.
    pub handles: bool,
}

/// Slices beside the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Slices {
    /// True if they are shown.
    pub shown: bool,
    /// Crosshair in which they meet, mm RAS; `None` for the middle of the scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_mm: Option<DVec3>,
    /// Intensities that are black and white; `None` until they are shown for the first time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window: Option<[f64; 2]>,
}

impl Slices {
    fn is_default(&self) -> bool {
        *self == Slices::default()
    }
}

/// Measured distance: two points and the line between them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Distance {
    /// First end, mm RAS.
    pub from_mm: DVec3,
    /// Second end, mm RAS.
    pub to_mm: DVec3,
}

/// Part of the state that undo restores: everything that is edited, but not the camera, mode or quality.
#[derive(Clone, Debug, PartialEq)]
pub struct Edited {
    transfer: Transfer,
    light: Light,
    background: DVec3,
    edges: Edges,
    objects: Vec<Object>,
    clip: Clip,
    distances: Vec<Distance>,
    deleted: Vec<Deletion>,
}

impl Edited {
    /// Returns true if both lists of objects are of the same fits and labels.
    pub fn has_objects_of(&self, other: &Edited) -> bool {
        let key = |o: &Object| (o.file, o.label);
        self.objects.iter().map(key).eq(other.objects.iter().map(key))
    }
}

impl Default for Quality {
    fn default() -> Self {
        Quality { step: None, splat_budget: None, target_frame_ms: 1000.0 / 60.0, adaptive: true }
    }
}

impl Default for Show {
    fn default() -> Self {
        Show {
            panels: true,
            overlay: false,
            orientation: true,
            scale_bar: true,
            colour_bar: true,
            cube: true,
            handles: true,
        }
    }
}

impl Distance {
    /// Returns its length, mm.
    pub fn mm(&self) -> f64 {
        self.from_mm.distance(self.to_mm)
    }
}

impl Object {
    /// Creates a row for a fit or one of its labels, visible and with the colours of the transfer function.
    pub fn new(file: usize, label: Option<u8>, name: impl Into<String>) -> Self {
        Object { file, label, name: name.into(), visible: true, tint: None, opacity: 1.0, transfer: None }
    }

    /// Returns its appearance for the renderer.
    fn appearance(&self) -> Appearance {
        let tint = self.tint.map(|colour| colour.as_vec3().to_array());
        Appearance { visible: self.visible, tint, opacity: self.opacity as f32 }
    }
}

impl Plane {
    /// Returns the engine's clip plane; `None` if it is off or its normal has no direction.
    fn engine(&self) -> Option<ClipPlane> {
        let normal = self.normal.try_normalize()?;
        self.on.then_some(ClipPlane { normal, offset: self.offset_mm })
    }
}

impl Clip {
    /// Returns the planes that are on, with those of the crop box, for the engine.
    pub fn planes(&self) -> Vec<ClipPlane> {
        let crop = self.crop.filter(|b| b.on).map(|b| ClipPlane::around(b.low_mm, b.high_mm));
        self.planes.iter().filter_map(Plane::engine).chain(crop.into_iter().flatten()).collect()
    }
}

impl ViewState {
    /// Creates an empty state with a transfer function.
    pub fn new(transfer: &TransferFunction) -> Self {
        ViewState {
            version: VERSION,
            shown: Subject::default(),
            mode: SplatMode::default(),
            split: None,
            edges: Edges::default(),
            field_memory: None,
            background: DVec3::ZERO,
            files: Files::default(),
            orbit: Orbit::default(),
            bookmarks: Vec::new(),
            quality: Quality::default(),
            show: Show::default(),
            errors: ErrorColours::default(),
            slices: Slices::default(),
            clip: Clip::default(),
            light: Light::default(),
            transfer: Transfer::new(transfer),
            objects: Vec::new(),
            distances: Vec::new(),
            deleted: Vec::new(),
            headset: None,
        }
    }

    /// Returns how splats are decoded. What is near and seen follows from a picture that is nearly twice as wide as high,
    /// as windows are.
    pub fn decoding(&self) -> DecodeOptions {
        let budget = |bytes| FieldBudget { bytes, camera: Some(self.orbit.camera(16.0 / 9.0)) };
        DecodeOptions { pitch: 1.0, edges: self.edges, budget: self.field_memory.map(budget) }
    }

    /// Returns the subjects of the picture that are `there`: the one that is shown, or, if the picture is split,
    /// the splats to the left and those beside them, or else the volume, to the right.
    pub fn subjects(&self, there: impl Fn(Subject) -> bool) -> Vec<Subject> {
        let right = if there(Subject::Beside) { Subject::Beside } else { Subject::Volume };
        let wanted = match self.split {
            Some(_) => vec![Subject::Splats, right],
            None => vec![self.shown],
        };
        wanted.into_iter().filter(|subject| there(*subject)).collect()
    }

    /// Returns the one of the [subjects](ViewState::subjects) that is seen at `x`, a fraction of the picture's width.
    pub fn subject_at(&self, x: f64, there: impl Fn(Subject) -> bool) -> Option<Subject> {
        let subjects = self.subjects(there);
        let right = self.split.is_some_and(|split| x >= split);
        subjects.get(usize::from(right)).or(subjects.first()).copied()
    }

    /// Returns the name of the engine's mode that the user has chosen for a subject.
    pub fn mode_of(&self, subject: Subject) -> &'static str {
        match subject {
            Subject::Splats | Subject::Beside => self.mode.name,
            Subject::Volume => OF_VOLUMES,
        }
    }

    /// Returns the look of a scene. `numbers` are the scene's numbers of the rows of [`ViewState::objects`];
    /// empty for a volume.
    ///
    /// # Errors
    /// Returns the errors of [`TransferFunction::new`].
    pub fn look(&self, numbers: &[u8]) -> Result<Look> {
        let objects = numbers.iter().zip(&self.objects).map(|(number, row)| (*number, row.appearance()));
        let objects = objects.collect();
        let own = numbers.iter().zip(&self.objects);
        let own = own.filter_map(|(number, row)| Some((*number, row.transfer.as_ref()?.function())));
        let functions = own.map(|(number, function)| Ok((number, function?))).collect::<Result<_>>()?;
        let (transfer, clip, light) = (self.transfer.function()?, self.clip.planes(), self.light);
        Ok(Look { transfer, clip, objects, functions, light })
    }

    /// Replaces the list of objects by those found in the files. Rows that are there already, from a session
    /// file, stay as they are; rows of objects that are gone are dropped. Returns true if the objects are others than
    /// before.
    pub fn set_objects(&mut self, found: Vec<Object>) -> bool {
        let known = std::mem::take(&mut self.objects);
        let key = |o: &Object| (o.file, o.label);
        let others = !known.iter().map(key).eq(found.iter().map(key));
        let row = |new: Object| {
            let old = known.iter().find(|o| key(o) == key(&new));
            old.cloned().unwrap_or(new)
        };
        self.objects = found.into_iter().map(row).collect();
        others
    }

    /// Changes the rows of objects as flags say. `there` are the objects of the splats, `numbers` those of the rows,
    /// `range` that of the intensities, for presets that are stretched over it.
    ///
    /// # Errors
    /// Returns the errors of [`ObjectChange::apply`].
    pub fn change_objects(
        &mut self,
        there: &[splat::Object],
        numbers: &[u8],
        range: [f64; 2],
        changes: &[ObjectChange],
    ) -> Result<()> {
        let mut look = self.look(numbers)?;
        for change in changes {
            change.apply(there, &mut look, range)?;
        }
        for (row, number) in self.objects.iter_mut().zip(numbers) {
            let Some(Appearance { visible, tint, opacity }) = look.objects.get(number) else { continue };
            row.transfer = look.functions.get(number).map(Transfer::new);
            (row.visible, row.opacity) = (*visible, f64::from(*opacity));
            row.tint = tint.map(|colour| DVec3::from_array(colour.map(f64::from)));
        }
        Ok(())
    }

    /// Returns the part of the state that undo restores.
    pub fn edited(&self) -> Edited {
        Edited {
            transfer: self.transfer.clone(),
            light: self.light,
            background: self.background,
            edges: self.edges,
            objects: self.objects.clone(),
            clip: self.clip.clone(),
            distances: self.distances.clone(),
            deleted: self.deleted.clone(),
        }
    }

    /// Returns true if undo would restore nothing from this to `edited`.
    pub fn is_edited_as(&self, edited: &Edited) -> bool {
        let Edited { transfer, light, background, edges, objects, clip, distances, deleted } = edited;
        (&self.transfer, &self.light, &self.background, &self.edges, &self.objects)
            == (transfer, light, background, edges, objects)
            && (&self.clip, &self.distances, &self.deleted) == (clip, distances, deleted)
    }

    /// Restores what undo brings back.
    pub fn restore(&mut self, edited: Edited) {
        let Edited { transfer, light, background, edges, objects, clip, distances, deleted } = edited;
        (self.transfer, self.light, self.background, self.objects) = (transfer, light, background, objects);
        self.edges = edges;
        (self.clip, self.distances, self.deleted) = (clip, distances, deleted);
    }

    /// Drops what belongs to files that are not open, as after files that could not be read: rows, deletions,
    /// and splats that would stand beside nothing.
    pub fn forget_missing_files(&mut self) {
        let files = self.files.splats.len();
        if files == 0 {
            self.files.beside = None;
        }
        if self.shown == Subject::Beside && self.files.beside.is_none() {
            self.shown = Subject::Splats;
        }
        self.objects.retain(|object| object.file < files);
        self.deleted.retain(|deletion| deletion.is_sound(files));
    }

    /// Leaves out a file that is not there, and what belongs to it: rows, deletions, the region of a volume.
    pub fn leave_out(&mut self, path: &Path) {
        while let Some(file) = self.files.splats.iter().position(|splats| splats == path) {
            self.files.splats.remove(file);
            self.objects.retain(|object| object.file != file);
            self.objects.iter_mut().filter(|o| o.file > file).for_each(|object| object.file -= 1);
            self.deleted.retain_mut(|deletion| deletion.survives_without(file));
        }
        let files = &mut self.files;
        files.beside.take_if(|beside| beside == path);
        if files.roi.as_deref() == Some(path) {
            files.set_region(None);
        }
        if files.volume.as_deref() == Some(path) {
            (files.volume, files.series) = (None, None);
            files.set_region(None);
        }
        self.forget_missing_files();
    }

    /// Reads a session file, or one that is packed with its files, which are unpacked for as long as
    /// [`Files::unpacked`] lives. Relative paths begin at the file's folder; what is not where a path says is
    /// looked for beside the session. [`Files::missing`] names what is nowhere.
    ///
    /// # Errors
    /// Returns [`Kind::Missing`], [`Kind::Io`], or [`Kind::BadData`] with the line and what is wrong with it.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let unpacked = is_packed(path).then(|| Unpacked::of(path)).transpose()?;
        let file = unpacked.as_ref().map_or(path.to_owned(), Unpacked::session);
        let mut state = ViewState::parse(&text_of(&file, MAX_BYTES)?).map_err(|e| e.file(path))?;
        state.files.unpacked.extend(unpacked);
        state.files.find_from(file.parent().unwrap_or(Path::new("")))?;
        Ok(state)
    }

    /// Writes a session file, whole or not at all. The paths of files in its folder or below begin there, so that
    /// all of them can be moved together; other paths are absolute.
    ///
    /// # Errors
    /// Returns the errors of [`ViewState::check_name`], [`ViewState::text`] and [`engine::output::write_atomic`].
    pub fn write(&self, path: impl AsRef<Path>, force: bool) -> Result<()> {
        let path = path.as_ref();
        Self::check_name(path)?;
        let files = self.files.seen_from(path.parent().unwrap_or(Path::new("")));
        let text = ViewState { files, ..self.clone() }.text()?;
        engine::output::write_atomic(path, force, |out| out.write_all(text.as_bytes()))
    }

    /// Checks that a file may be a session that is written: splats, or a zip with all files of a case, must not be
    /// replaced by one.
    ///
    /// # Errors
    /// Returns [`Kind::Usage`] for a name that does not end in `.toml`.
    pub fn check_name(path: &Path) -> Result<()> {
        if path.extension().is_some_and(|end| end.eq_ignore_ascii_case("toml")) {
            return Ok(());
        }
        let message = "a session is written as a .toml";
        Err(Error::new(Kind::Usage, "VGS-VIEW-053", message).file(path).help("end its name in .toml"))
    }

    /// Returns the text of a session file.
    ///
    /// # Errors
    /// Returns [`Kind::Usage`] if the path of a file is not UTF-8, which TOML cannot hold.
    pub fn text(&self) -> Result<String> {
        toml_text(self)
    }

    /// Parses the text of a session file.
    ///
    /// # Errors
    /// Returns [`Kind::BadData`].
    pub fn parse(text: &str) -> Result<Self> {
        let help = "a session file is written by `vgs view`; correct the line, or start without it";
        let version = |text: &str| text.parse::<toml::Table>().ok()?.get("version")?.as_integer();
        if let Some(found) = version(text).filter(|v| *v != i64::from(VERSION)) {
            let message = format!("a session file of version {found}; this program reads {VERSION}");
            return Err(Error::new(Kind::BadData, "VGS-VIEW-001", message)
                .help("open it with the program that wrote it, or start without it"));
        }
        let state: ViewState = toml::from_str(text).map_err(|e| {
            Error::new(Kind::BadData, "VGS-VIEW-002", format!("not a session file: {e}")).help(help)
        })?;
        state.check()?;
        Ok(state)
    }

    fn check(&self) -> Result<()> {
        self.orbit.check()?;
        self.bookmarks.iter().try_for_each(|bookmark| bookmark.orbit.check())?;
        self.transfer.function()?;
        let share = |v: f64| (0.0..=1.0).contains(&v);
        let colour = |c: DVec3| c.to_array().into_iter().all(share);
        let plane = |p: &Plane| p.normal.try_normalize().is_some() && p.offset_mm.is_finite();
        let crop =
            |b: &CropBox| b.low_mm.is_finite() && b.high_mm.is_finite() && b.low_mm.cmple(b.high_mm).all();
        let object =
            |o: &Object| o.tint.is_none_or(colour) && share(o.opacity) && o.file < self.files.splats.len();
        let Quality { step, splat_budget, target_frame_ms, .. } = self.quality;
        let ends = |d: &Distance| d.from_mm.is_finite() && d.to_mm.is_finite();
        let rows = [
            (self.split.is_none_or(share), "split is not between 0 and 1"),
            (
                self.files.beside.is_none() || !self.files.splats.is_empty(),
                "[files] beside stands beside splats, and there are none",
            ),
            (
                self.shown != Subject::Beside || self.files.beside.is_some(),
                "shown is \"beside\", and [files] has no such splats",
            ),
            (colour(self.background), "background is no colour: three numbers from 0 to 1 are needed"),
            (self.light.is_sound(), "[light] needs a direction in towards, and a fill from 0 to 0.5"),
            (self.clip.planes.len() <= MOST_PLANES, "there are too many [[clip.planes]]; there can be two"),
            (self.clip.planes.iter().all(plane), "a plane of [[clip.planes]] has no direction or offset"),
            (self.clip.crop.iter().all(crop), "[clip.box] needs low_mm below high_mm, both finite"),
            (self.objects.iter().all(object), "a row of [[objects]] has no such file, tint or opacity"),
            (
                step.is_none_or(|step| (0.05..=10.0).contains(&step)),
                "[quality] step is not between 0.05 and 10",
            ),
            (splat_budget != Some(0), "[quality] splat_budget is 0"),
            (
                self.errors.range.is_none_or(|range| range > 0.0 && range.is_finite()),
                "[errors] range is not above 0",
            ),
            (
                (1.0..=1000.0).contains(&target_frame_ms),
                "[quality] target_frame_ms is not between 1 and 1000",
            ),
            (self.distances.iter().all(ends), "an end of [[distances]] is not finite"),
            (
                self.headset.is_none_or(|place| place.is_sound()),
                "[headset] has no finite moved_m, no unit quaternion turned, or no scale above 0",
            ),
            (
                self.deleted.iter().all(|d| d.is_sound(self.files.splats.len())),
                "a row of [[deleted]] has no such files, or a box without low_mm below high_mm, both finite",
            ),
        ];
        match rows.iter().find(|(good, _)| !good) {
            None => Ok(()),
            Some((_, what)) => Err(Error::new(Kind::BadData, "VGS-VIEW-003", *what)
                .help("correct the line in the session file, or start without it")),
        }
    }
}

fn is_first<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Returns a value as TOML. Only paths can fail.
pub(crate) fn toml_text(value: &impl Serialize) -> Result<String> {
    toml::to_string(value).map_err(|e| {
        Error::new(Kind::Usage, "VGS-VIEW-005", format!("cannot be written as TOML: {e}"))
            .help("give files names in UTF-8")
    })
}

/// Reads a text file of at most `max_bytes` bytes.
pub(crate) fn text_of(path: &Path, max_bytes: u64) -> Result<String> {
    use std::io::Read;
    let failed = |e: &std::io::Error| Error::io(path, "reading settings", e);
    let file = engine::input::open(path).map_err(|e| failed(&e))?;
    let mut bytes = Vec::new();
    file.take(max_bytes + 1).read_to_end(&mut bytes).map_err(|e| failed(&e))?;
    let bad = |message: String| Error::new(Kind::BadData, "VGS-VIEW-002", message).file(path);
    if bytes.len() as u64 > max_bytes {
        return Err(bad(format!("larger than {max_bytes} bytes, so no file of this program")));
    }
    String::from_utf8(bytes)
        .map_err(|e| bad(format!("not text: byte {} is not UTF-8", e.utf8_error().valid_up_to())))
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
