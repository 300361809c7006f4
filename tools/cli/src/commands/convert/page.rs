//! Writes a page: splats in one HTML file that any browser shows.

use std::path::PathBuf;

use engine::render::{FOV_DEGREES, Look, bounds};
use engine::{Error, Kind};
use page::{Content, Page, Shown, Sizes, Source, Splats, Viewpoint};
use view::io::loaded_splats::LoadedSplats;
use view::io::sharing;
use view::model::state::ViewState;

use super::again::{fitted_again, given_back};
use super::arguments::ConvertArguments;
use super::selection::{Selection, nothing};
use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::bytes;
use crate::shared::viewing::{Background, View};
use crate::shared::waiting::Waiting;

/// Objects that are named after a page was written; of more the number is told.
const NAMED: usize = 12;

/// What is shown, and how a session showed it.
struct Scene {
    splats: Splats,
    look: Option<Look>,
    viewpoint: Option<Viewpoint>,
    background: [f64; 3],
}

/// Writes the page of the splats or of the session.
pub fn write(
    arguments: &ConvertArguments,
    session: Option<ViewState>,
    console: &Console,
) -> Result<u8, Stop> {
    let scene = match session {
        Some(state) => of_session(arguments, state)?,
        None => of_files(arguments)?,
    };
    let Scene { mut splats, look, viewpoint, background } = scene;
    let whole = splats.set.count();
    let mut device = || arguments.device.boot();
    if let Some(selection) = Selection::of(arguments, &splats.set.objects())? {
        splats = splats.selected(&|number, mean| selection.has(number, mean));
        if splats.set.is_empty() {
            return Err(nothing(arguments, whole).into());
        }
    }
    let look = arguments.look(&splats.set, look)?;
    let shown = Shown {
        title: arguments.page.title.as_deref(),
        look: &look,
        viewpoint: viewpoint_of(arguments, &splats, viewpoint)?,
        background: background_of(arguments)?.unwrap_or(background),
    };
    let content = {
        let _waiting = Waiting::on("preparing the data of the page");
        Content::of(&splats, &mut device)?
    };
    let page = Page::new(content, &splats.set, &shown)?;
    let sizes = page.write(&arguments.output, arguments.force)?;
    let is_of_splats = !splats.set.splats.is_empty();
    tell(arguments, console, &page, &sizes, ([splats.set.count(), whole], is_of_splats))?;
    Ok(0)
}

/// Returns the splats of files.
fn of_files(arguments: &ConvertArguments) -> Result<Scene, Stop> {
    let mut sources =
        arguments.splats.iter().map(|path| Source::read(path)).collect::<engine::Result<Vec<_>>>()?;
    // These are for one file alone.
    for source in &mut sources {
        let mut set = None;
        if let Some(original) = &arguments.like {
            set = Some(given_back(arguments, source.set.clone(), original)?);
        }
        if let Some(volume) = &arguments.volume {
            set = Some(fitted_again(arguments, set.as_ref().unwrap_or(&source.set), volume)?);
        }
        if let Some(set) = set {
            *source = Source::of(source.stem.clone(), set);
        }
    }
    let splats = Splats::join(sources).map_err(|error| error.file(arguments.first()))?;
    Ok(Scene { splats, look: None, viewpoint: None, background: [0.0; 3] })
}

/// Returns what a session shows of its splats.
fn of_session(arguments: &ConvertArguments, mut state: ViewState) -> Result<Scene, Stop> {
    let paths = &state.files.splats;
    if paths.is_empty() {
        return Err(arguments.without_splats().into());
    }
    let sources = paths.iter().map(|path| Source::read(path)).collect::<engine::Result<Vec<_>>>()?;
    let sets = paths.iter().zip(&sources).map(|(path, source)| (path.clone(), source.set.clone()));
    let mut loaded = LoadedSplats::join(sets.collect::<Vec<(PathBuf, _)>>())?;
    let mut unchanged = Some(sources);
    if !state.deleted.is_empty() {
        loaded = loaded.without(&state.deleted);
        unchanged = None;
    }
    state.set_objects(loaded.objects.iter().map(|(row, ..)| row.clone()).collect());
    let (splats, look) = sharing::splats(&state, &loaded, unchanged)?;
    let viewpoint = Some(sharing::viewpoint(&state.orbit));
    Ok(Scene { splats, look: Some(look), viewpoint, background: state.background.to_array() })
}

/// Returns where the scene is seen from: as the flags say, else as the session says, else from the front.
fn viewpoint_of(
    arguments: &ConvertArguments,
    splats: &Splats,
    session: Option<Viewpoint>,
) -> engine::Result<Viewpoint> {
    let from = |side: &str| {
        let (degrees, zoom) = (arguments.page.fov.unwrap_or(FOV_DEGREES), arguments.page.zoom.unwrap_or(1.0));
        Viewpoint::from_side(side, bounds(&splats.set), degrees, zoom)
    };
    match (&arguments.page.camera, session) {
        (Some(View::Side(name)), _) => from(name),
        (Some(View::File(file)), _) => Viewpoint::of_file(file),
        (None, Some(viewpoint)) => Ok(viewpoint),
        (None, None) => from("anterior"),
    }
}

/// Returns the background that the flags ask for.
fn background_of(arguments: &ConvertArguments) -> engine::Result<Option<[f64; 3]>> {
    match arguments.page.background {
        None => Ok(None),
        Some(Background(Some(colour))) => Ok(Some(colour.map(f64::from))),
        Some(Background(None)) => {
            let message = "a page has a colour behind the picture, and this is none";
            Err(Error::new(Kind::Usage, "VGS-CLI-163", message).help("choose a --background"))
        }
    }
}

/// Says what was written, and what is in it.
fn tell(
    arguments: &ConvertArguments,
    console: &Console,
    page: &Page,
    sizes: &Sizes,
    ([count, whole], is_of_splats): ([usize; 2], bool),
) -> engine::Result<()> {
    let output = &arguments.output;
    let scene = &page.scene;
    if console.json {
        let objects: Vec<_> = scene
            .objects
            .iter()
            .map(|object| serde_json::json!({ "number": object.number, "name": object.name, "visible": object.visible }))
            .collect();
        return console.json_data(&serde_json::json!({
            "output": output, "title": scene.title, "splats": count, "left_out": whole - count,
            "bytes": sizes.page, "program_bytes": sizes.program, "data_bytes": sizes.data,
            "parts": scene.parts, "objects": objects, "transfer_function": scene.function.name,
        }));
    }
    if whole > count {
        console.say(&format!("{} of {whole} splats are not selected, and not in the page", whole - count));
    }
    let as_voxels = scene.parts.iter().all(|part| part.kind == page::PartKind::Voxels);
    console.say(&format!(
        "{}: {}, of it {} of program and {} of data ({count} {}{})",
        output.display(),
        bytes(sizes.page),
        bytes(sizes.program),
        bytes(sizes.data),
        if is_of_splats { "splats" } else { "voxels" },
        if is_of_splats && as_voxels { " as voxels" } else { "" },
    ));
    let names: Vec<_> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    let named = match names.len() {
        few if few <= NAMED => names.join(", "),
        many => format!("{many} objects"),
    };
    let another = if arguments.page.title.is_none() { " (--title gives it another)" } else { "" };
    console.say(&format!("its title is {:?}{another}, and it names {named}", scene.title));
    let hides = !scene.clip.is_empty() || scene.objects.iter().any(|object| !object.visible);
    let too = if hides { ", with what is hidden or cut away (--object and --box leave out)" } else { "" };
    console.say(&format!(
        "it opens in any browser and sends nothing; whoever has the file has the data in it{too}"
    ));
    Ok(())
}
