//! Flags of `vgs convert`.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use engine::render::ObjectChange;
use engine::splat::PlyLayout;
use engine::{Error, Kind};
use view::model::state::{ViewState, is_session};

use crate::shared::flags::{Clip, Corners, DeviceArguments, pair};
use crate::shared::inputs::{CleaningArguments, ReadArguments, RoiArguments};
use crate::shared::splat_files::layout;
use crate::shared::viewing::{Background, View, degrees, zoom};

/// The flags that name a region.
const REGION: &str = "Coding a region, or fitting again";
/// Endings of pages.
const PAGES: [&str; 2] = ["html", "htm"];

/// Writes splats in another format, or codes the region of a volume within a bound; the extension of the output names
/// the format
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct ConvertArguments {
    /// The splats, for a page (.html) also several files, which it shows together; or a session of `vgs view` (.toml):
    /// what it shows of its splats, as it shows it; or a volume, whose region is coded without splats (.vgs)
    #[arg(required = true, value_name = "SPLATS|SESSION|VOLUME")]
    pub splats: Vec<PathBuf>,
    /// The splats as vgs wrote them, where SPLATS are what another program has made of these without the
    /// comments of vgs: kernel, background, grid and names of labels are taken from there
    #[arg(long, value_name = "ORIGINAL")]
    pub like: Option<PathBuf>,
    /// The file: .vgs, which is small and rounded, or .ply. For people: .html, a page that any browser opens by itself, with
    /// a live transfer function. For programs that draw splats and know no intensities: .spz, which is small,
    /// .sog (for PlayCanvas), or .glb (glTF with KHR_gaussian_splatting), from which vgs reads the HU again
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    pub output: PathBuf,
    /// Puts the splats with their HU into an .spz as well (its version 4): vgs opens it with a live transfer function,
    /// other viewers show the colours, where they know that version
    #[arg(long, help_heading = "Output")]
    pub live: bool,
    /// How a PLY is laid out: vgs (HU as one more property, what most programs read), or inria (rows of 62
    /// floats, for programs that know no others)
    #[arg(long, value_name = "LAYOUT", default_value = "vgs", value_parser = worldly_layout, help_heading = "Output")]
    pub ply_layout: &'static PlyLayout,
    /// Gives the splats the colours and opacities of a transfer function in place of their HU, as .spz, .sog
    /// and .glb need it: a preset, a file, or window:WIDTH,LEVEL, as in `vgs render` [default for these: of several
    /// objects the usual look of each; of one CT-Bone, or MR-Default without HU; where that shows nothing of the
    /// splats, a preset that does]
    #[arg(long, value_name = "PRESET|FILE", help_heading = "Colours")]
    pub tf: Option<String>,
    /// Gives each object a colour of its own, the one that is usual for its name, as in `vgs render`
    #[arg(long, help_heading = "Colours")]
    pub object_colours: bool,
    /// Only what is on this side: x<MM, x>MM and the like are cut away, as in `vgs render`; may be repeated. In a page the
    /// planes can be moved, so that what they cut away is in the file; --box leaves it out
    #[arg(long, value_name = "PLANE|BOX", allow_hyphen_values = true, help_heading = "Selection")]
    pub clip: Vec<Clip>,
    /// Only splats whose middle lies in this box, mm RAS
    #[arg(
        long = "box",
        value_name = "X0,Y0,Z0,X1,Y1,Z1",
        allow_hyphen_values = true,
        help_heading = "Selection"
    )]
    pub inside: Option<Corners>,
    /// Only splats whose middle lies outside of this box
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", allow_hyphen_values = true, help_heading = "Selection")]
    pub outside_box: Option<Corners>,
    /// Only the splats of this object, by name or number, as `vgs info` lists them, or of several, by a range (1-24), a
    /// pattern (rib_*) or all. NAME:HOW chooses nothing and says how an object is shown, as in `vgs render`:
    /// colour=#rrggbb, opacity=0..1, tf=CT-Bone, hidden. May be repeated
    #[arg(long, value_name = "NAME|N|...[:HOW,...]", help_heading = "Selection")]
    pub object: Vec<ObjectFlag>,
    /// The volume that the splats were fitted to: a .vgs is then rounded more and fitted again to make up for
    /// it
    #[arg(long, value_name = "VOLUME", requires = "region", help_heading = "Fitting again",
          conflicts_with_all = ["inside", "outside_box", "object", "tf", "clip"])]
    pub volume: Option<PathBuf>,
    /// The mask of their fit, or of what is coded of a volume
    #[arg(long, value_name = "MASK", group = "region", help_heading = REGION)]
    pub roi: Option<PathBuf>,
    /// Instead of a mask: the voxels from LOW to HIGH, HU
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, allow_hyphen_values = true, group = "region",
          help_heading = REGION)]
    pub roi_threshold: Option<[f32; 2]>,
    /// Which labels of the mask, by number or name
    #[arg(long, value_name = "N|NAME|...", requires = "roi", help_heading = REGION)]
    pub roi_label: Option<String>,
    /// How far a voxel of the region may be off, in the unit of the volume; 0 keeps whole numbers as they are [default:
    /// 30 HU; without HU 1 % of the range of the region]
    #[arg(long, value_name = "HU", allow_negative_numbers = true, help_heading = REGION)]
    pub bound: Option<f64>,
    #[command(flatten)]
    pub page: PageArguments,
    #[command(flatten)]
    pub read: ReadArguments,
    #[command(flatten)]
    pub device: DeviceArguments,
    /// Replaces an output that exists
    #[arg(short, long, help_heading = "Output")]
    pub force: bool,
}

impl ConvertArguments {
    /// Returns the first file of the splats.
    pub fn first(&self) -> &Path {
        self.splats.first().map_or(Path::new(""), PathBuf::as_path)
    }

    /// Returns true if the output has the name of a page.
    pub fn writes_page(&self) -> bool {
        self.output.extension().is_some_and(|end| PAGES.iter().any(|known| end.eq_ignore_ascii_case(known)))
    }

    /// Returns the flags of the region, as other commands have them.
    pub fn region(&self) -> RoiArguments {
        RoiArguments {
            roi: self.roi.clone(),
            roi_threshold: self.roi_threshold,
            roi_label: self.roi_label.clone(),
            cleaning: CleaningArguments::default(),
        }
    }

    /// Fails if flags or files do not go with the output.
    pub fn check(&self) -> engine::Result<()> {
        let more = self.splats.get(1);
        let session = self.splats.iter().find(|path| is_session(path));
        if let (Some(session), Some(_)) = (session, more) {
            let message = "a session beside other files, and a session shows what it shows alone";
            return Err(Error::new(Kind::Usage, "VGS-CLI-159", message)
                .file(session)
                .help("give the session alone, or the splats without it"));
        }
        if let (Some(other), true) = (more, self.like.is_some() || self.volume.is_some()) {
            let message = "--like and --volume are for the splats of one file";
            return Err(Error::new(Kind::Usage, "VGS-CLI-160", message)
                .file(other)
                .help("convert each file to a .vgs first"));
        }
        if self.volume.is_none() && (self.roi.is_some() || self.roi_threshold.is_some()) {
            let message = "a region, and these are splats, which are fitted again only with their volume";
            return Err(Error::new(Kind::Usage, "VGS-CLI-164", message)
                .file(self.first())
                .help("add --volume, leave the region out, or give a volume in place of the splats"));
        }
        if self.bound.is_some() {
            let message = "--bound is for the voxels of a volume, and these are splats";
            return Err(Error::new(Kind::Usage, "VGS-CLI-165", message).file(self.first()).help(
                "leave it out, or give the volume and its mask: vgs convert ct.nii.gz --roi bones.nii.gz",
            ));
        }
        if self.writes_page() {
            return Ok(());
        }
        if let Some(other) = more {
            let message = "several files, and this format holds the splats of one";
            return Err(Error::new(Kind::Usage, "VGS-CLI-161", message)
                .file(other)
                .help("give one, or a name that ends in .html: a page shows several"));
        }
        if let Some(flag) = self.page.first() {
            let message = format!("{flag} is for pages, and this is the name of something else");
            return Err(Error::new(Kind::Usage, "VGS-CLI-162", message)
                .file(&self.output)
                .help("leave it out, or give a name that ends in .html"));
        }
        Ok(())
    }

    /// Reads the session.
    pub fn session(&self) -> engine::Result<ViewState> {
        if self.like.is_some() || self.volume.is_some() {
            let message = "--like and --volume are for splats, and this is a session";
            return Err(Error::new(Kind::Usage, "VGS-CLI-134", message)
                .file(self.first())
                .help("give the splats in place of the session"));
        }
        ViewState::read(self.first())
    }

    /// Returns the error of a session that has no splats.
    pub fn without_splats(&self) -> Error {
        Error::new(Kind::Usage, "VGS-CLI-135", "a session without splats")
            .file(self.first())
            .help("open splats in the window, and save the session again")
    }
}

/// Flags of a page.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Page")]
pub struct PageArguments {
    /// Title of the page [default: its objects, where they have names of anatomy; names of files are not told]
    #[arg(long, value_name = "TEXT")]
    pub title: Option<String>,
    /// From where it is seen at first, as in `vgs render`: a side, or a file [default: anterior, or that of the session]
    #[arg(long, value_name = "SIDE|FILE.json")]
    pub camera: Option<View>,
    /// Field of view from the upper to the lower edge, degrees, for a camera that is a side [default: 30]
    #[arg(long, value_name = "DEGREES", value_parser = degrees, requires = "camera")]
    pub fov: Option<f64>,
    /// How near a camera that is a side comes: 1 shows all, 2 half of it [default: 1]
    #[arg(long, value_name = "TIMES", value_parser = zoom, requires = "camera")]
    pub zoom: Option<f64>,
    /// Behind everything: black, white, grey or #rrggbb [default: black, or that of the session]
    #[arg(long, value_name = "COLOUR")]
    pub background: Option<Background>,
}

impl PageArguments {
    /// Returns the first flag that is given.
    pub fn first(&self) -> Option<&'static str> {
        let given = [
            (self.title.is_some(), "--title"),
            (self.camera.is_some(), "--camera"),
            (self.background.is_some(), "--background"),
        ];
        given.iter().find(|(given, _)| *given).map(|(_, name)| *name)
    }
}

const EXAMPLES: &str = "\
Examples:
  vgs convert bones.ply -o bones.vgs
  vgs convert bones.vgs -o bones.ply
  vgs convert bones.ply -o for-sibr.ply --ply-layout inria
  vgs convert body.ply -o kidney.vgs --object kidney_left --object kidney_right
  vgs convert bones.ply -o hip.ply --box=-150,-40,-900,0,80,-700
  vgs convert bones.ply -o bones.spz --tf CT-Bones-Steep
  vgs convert bones.ply -o bones.spz --live               for other viewers, and for vgs with any --tf
  vgs convert bones.ply -o bones.glb
  vgs convert bones.glb -o again.ply
  vgs convert organs.ply -o organs.glb --object-colours --object liver:opacity=0.3
  vgs convert session.toml -o scene.glb                  what the window showed
  vgs convert bones.vgs -o bones.html                    a page, which any browser opens
  vgs convert bones.vgs vessels.vgs -o both.html --title \"Hip, before\" --camera left
  vgs convert edited.ply --like bones.ply -o edited-bones.ply
  vgs convert bones.ply -o bones.vgs --volume ct.nii.gz --roi bones.nii.gz      a fifth smaller
  vgs convert ct.nii.gz --roi bones.nii.gz -o bones.vgs              no splats: each voxel within 30 HU
  vgs convert ct.nii.gz --roi bones.nii.gz -o bones.vgs --bound 0    as it is";

/// A value of `--object`: a choice of objects, or how they are shown.
#[derive(Clone, Debug)]
pub enum ObjectFlag {
    /// A choice.
    Chosen(String),
    /// How objects are shown.
    Shown(ObjectChange),
}

impl FromStr for ObjectFlag {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.contains(':') {
            true => text.parse().map(ObjectFlag::Shown),
            false => Ok(ObjectFlag::Chosen(text.to_owned())),
        }
    }
}

/// Parses the name of a layout that needs no volume.
fn worldly_layout(text: &str) -> Result<&'static PlyLayout, String> {
    match layout(text)? {
        found if found.needs_volume => {
            Err(format!("{text} needs the volume of the splats: vgs fit --ply-layout {text}"))
        }
        found => Ok(found),
    }
}

#[cfg(test)]
mod tests {
    use engine::splat::PLY_LAYOUTS;

    use super::*;

    #[test]
    fn a_layout_that_needs_the_volume_is_refused() {
        let usable: Vec<_> =
            PLY_LAYOUTS.iter().filter_map(|row| worldly_layout(row.name).ok()).map(|row| row.name).collect();
        assert_eq!(usable, ["vgs", "inria"]);
    }
}
