//! What is shown and what may be done with it: plain data and logic, which know no window, no file and no panel.
//!
//! | module | what it is |
//! |---|---|
//! | `state` | [`ViewState`](state::ViewState), the session file: all that is shown |
//! | `orbit`, `transfer`, `region`, `deletions` | its camera, transfer function, region, and what is deleted of the splats |
//! | `settings`, `picture_options`, `fit_plan` | what is remembered from start to start; how a picture is written; what a fit is asked for and how far it is |
//! | `actions`, `history` | what a user may ask for, with its keys; undo |
//! | `cube`, `slices`, `histogram` | the patient's sides, planes through the data, counts |
//! | `panel_info`, `thumbnails` | what panels are told anew for each frame |
//! | `series`, `file_list`, `system_dialog` | series to choose from, files to choose from, what the dialog of the desktop is asked |

pub mod actions;
pub mod cube;
pub mod deletions;
pub mod file_list;
pub mod fit_plan;
pub mod histogram;
pub mod history;
pub mod orbit;
pub mod panel_info;
pub mod picture_options;
pub mod region;
pub mod series;
pub mod settings;
pub mod slices;
pub mod state;
pub mod system_dialog;
pub mod thumbnails;
pub mod transfer;
