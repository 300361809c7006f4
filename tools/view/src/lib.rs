//! The desktop viewer.
//!
//! What is shown is plain data ([`ViewState`], the session file); panels draw it into any [`egui::Ui`] and
//! change it, and know neither windows nor the device. [`App`] puts them together; `window::run` shows it in
//! a window. Without the feature `window` only the rest is built, for programs that show panels elsewhere.
//!
//! The map, with the arrows that are allowed ("A -> B": A may use B; `tests/tests/arrows` checks them):
//!
//! ```text
//! window -> viewer -> input_queue, app, canvas, export, loaded_data, loader, open_files, pack, report, settings, panel_info, actions -> state
//! viewer -> fitting, sorting, fit_plan, transfer, thumbnails, rendered_scene       app -> fit_plan, figures, region
//! window -> theme          window -> portal -> system_dialog          viewer, app, prompt -> system_dialog
//! app -> prompt, annotations -> panels -> editor -> transfer, histogram, theme
//! app -> history, handles, cube          annotations -> handles, cube -> orbit          prompt, annotations -> state, theme
//! app, prompt, panels -> actions -> orbit          app, panels -> panel_info -> histogram, state          app, panels -> theme
//! panels -> slices, figures          panel_info -> thumbnails -> state, orbit
//! app, handles, annotations, panels -> state -> orbit, region, transfer, deletions          app -> settings, editor, transfer
//! loader, loaded_data -> loaded_splats -> state, saving          app, panels, actions, prompt, viewer, loader, loaded_data, loaded_splats -> deletions
//! fitting, panels, panel_info -> fit_plan -> figures          actions, panels, panel_info -> region
//! pack -> state          export -> overlay_image -> annotations, painter, state          export -> orbit
//! viewer, prompt, actions, export -> picture_options
//! prompt -> file_list -> figures
//! loaded_data -> panel_info          export -> loaded_data -> loader -> pick, histogram          export, loaded_data, loader, settings, handles -> state
//! loader -> sorting -> state, region          fitting -> loader -> region          app, panels, loader -> series -> state
//! canvas -> rendered_scene -> composer          canvas -> painter          handles, annotations -> orbit
//! state     what is shown: the session file; `orbit` is its camera, `transfer` its transfer function, `region` that of
//!           the volume, `deletions` are what is deleted of the splats
//! system_dialog   what the dialog of the desktop is asked; `portal` shows it over D-Bus
//! actions   what a user may ask for, with its keys; `settings` what is remembered from start to start
//! editor, handles, history, pick, histogram   plain logic: of the curve, the planes, undo, the cursor, the counts; `cube` of the
//!           patient's sides; `slices`: planes through the data
//! panels    what shows and changes the state, drawn by egui; `prompt` asks for a file, `file_list` shows
//!           what there is, `annotations` are over the picture
//! picture_options  how a picture is written; `overlay_image` is what the window tells, painted into it
//! panel_info     what panels are told anew for each frame
//! app       the viewer without its window: puts the panels together
//! loader, export, pack   read and write beside the window; `loaded_data` is what was read, `loaded_splats` what is left of
//!           the splats, `saving` how it is written, `open_files` where they are from; `sorting` tells volumes and masks apart,
//!           `series` are those of a folder, of which one is meant
//! fitting   fits splats beside the window; `fit_plan` is what a fit is asked for and how far it is, `figures` words for it
//! canvas    the picture in the window: `rendered_scene` renders it, `composer` and `painter` put it and the panels on the screen
//! viewer    frame after frame, within the frame budget, each with what `input_queue` has for it; `report` is what was measured
//! window    the events of winit
//! ```
#![forbid(unsafe_code)]

pub mod actions;
pub mod annotations;
pub mod app;
#[cfg(feature = "window")]
pub mod canvas;
pub mod composer;
pub mod cube;
pub mod deletions;
pub mod editor;
pub mod export;
pub mod figures;
pub mod file_list;
pub mod fit_plan;
pub mod fitting;
pub mod handles;
pub mod histogram;
pub mod history;
pub mod input_queue;
pub mod loaded_data;
pub mod loaded_splats;
pub mod loader;
pub mod open_files;
pub mod orbit;
pub mod overlay_image;
pub mod pack;
pub mod painter;
pub mod panel_info;
pub mod panels;
pub mod pick;
pub mod picture_options;
#[cfg(all(feature = "window", unix, not(target_os = "macos"), not(target_os = "android")))]
pub mod portal;
pub mod prompt;
pub mod region;
pub mod rendered_scene;
pub mod report;
pub mod saving;
pub mod series;
pub mod settings;
pub mod slices;
pub mod sorting;
pub mod state;
pub mod system_dialog;
pub mod theme;
pub mod thumbnails;
pub mod transfer;
#[cfg(feature = "window")]
pub mod viewer;
#[cfg(feature = "window")]
pub mod window;

pub use actions::Action;
pub use app::{App, Changes};
pub use histogram::Histogram;
pub use orbit::Orbit;
pub use panel_info::{PanelInfo, Statistics};
pub use pick::Probe;
pub use settings::Settings;
pub use state::ViewState;
