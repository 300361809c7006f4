//! Pages of what a state shows: one HTML file that any browser opens.

use std::path::Path;

use engine::Result;
use engine::gpu::Gpu;
use engine::render::Look;
use page::{Content, Page, Shown, Sizes, Source, Splats, Viewpoint, names};

use crate::io::loaded_splats::LoadedSplats;
use crate::model::orbit::Orbit;
use crate::model::state::{Files, Object, ViewState};

/// Returns the splats of a page of a state, and how it shows them. `loaded` are those that deletions have left; `unchanged`
/// the files that they are from, if nothing is deleted.
///
/// # Errors
/// Returns the errors of [`ViewState::look`] and of [`Splats::join`].
pub fn splats(
    state: &ViewState,
    loaded: &LoadedSplats,
    unchanged: Option<Vec<Source>>,
) -> Result<(Splats, Look)> {
    let (mut set, numbers) = loaded.of_files();
    let look = state.look(&numbers)?;
    let sources = unchanged.unwrap_or_else(|| {
        // Names of files are not for everybody; those of labels are what the splats are of.
        let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let stems: Vec<_> = state.files.splats.iter().map(|path| stem(path)).collect();
        let name = |(place, (row, ..)): (usize, &(Object, u8, usize))| match row.label {
            Some(_) if stems.len() > 1 => {
                row.name.split_once('/').map_or(row.name.as_str(), |(_, label)| label).to_owned()
            }
            Some(_) => row.name.clone(),
            None => {
                names::of_file(stems.get(row.file).map_or("", String::as_str), place, loaded.objects.len())
            }
        };
        let names = names::told_apart(loaded.objects.iter().enumerate().map(name).collect());
        let named = numbers.iter().copied().zip(names).filter(|(number, _)| *number > 0);
        if set.labels.is_some() {
            set.label_names = named.collect();
        }
        vec![Source::of(stems.into_iter().next().unwrap_or_default(), set)]
    });
    Ok((Splats::join(sources)?, look))
}

/// Returns the viewpoint of a camera.
pub fn viewpoint(orbit: &Orbit) -> Viewpoint {
    let [_, up, _] = orbit.axes();
    Viewpoint {
        eye: orbit.eye_mm().to_array(),
        target: orbit.pivot_mm.to_array(),
        up: up.to_array(),
        field_of_view: orbit.fov_deg,
    }
}

/// Writes what a state shows as a page. Waits for the device where splats have to be rounded or decoded.
///
/// # Errors
/// Returns the errors of [`splats`], of [`Content::of`], of [`Page::new`] and of [`Page::write`].
pub fn write(
    gpu: &Gpu,
    state: &ViewState,
    loaded: &LoadedSplats,
    title: &str,
    path: &Path,
    force: bool,
) -> Result<Sizes> {
    let unchanged = state.deleted.is_empty().then(|| sources(&state.files, loaded)).flatten();
    let (splats, look) = splats(state, loaded, unchanged)?;
    let shown = Shown {
        title: Some(title),
        look: &look,
        viewpoint: viewpoint(&state.orbit),
        background: state.background.to_array(),
    };
    let content = Content::of(&splats, &mut || Ok(gpu.clone()))?;
    Page::new(content, &splats.set, &shown)?.write(path, force)
}

/// Reads the files of loaded splats again, for what a file holds is what it held; `None` if they are not what they were, or
/// if only a volume can place them.
fn sources(files: &Files, loaded: &LoadedSplats) -> Option<Vec<Source>> {
    let sources = files.splats.iter().map(|path| Source::read(path).ok()).collect::<Option<Vec<_>>>()?;
    let count: usize = sources.iter().map(|source| source.set.splats.len()).sum();
    let ranges = sources.iter().filter_map(|source| source.set.intensity_range());
    let range = ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    (count == loaded.set.splats.len() && range == loaded.set.intensity_range()).then_some(sources)
}
