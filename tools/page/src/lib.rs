//! Pages: a scene of splats in one HTML file, which shows it with a live transfer function in any browser.
//!
//! | file | what it is |
//! |---|---|
//! | `page` | [`Page`]: a scene with its data, written as HTML and read again |
//! | `scene` | [`Scene`]: what a page is told of its scene |
//! | `content` | [`Content`]: its data, as files of splats or as voxels |
//! | `voxels` | a decoded field as bytes |
//! | `splats`, `source` | [`Splats`]: the splats that it is made of, and a [`Source`] of them |
//! | `names` | names that a page may tell |
//! | `text` | bytes as text |
//!
//! The program of a page is `bundle/page.html`, which `web/build.mjs` makes of the sources in `web`.
#![forbid(unsafe_code)]

mod content;
pub mod names;
mod page;
mod scene;
mod source;
mod splats;
mod text;
mod voxels;

pub use content::Content;
pub use page::{Page, Shown, Sizes};
pub use scene::{Function, Part, PartKind, Plane, Scene, SceneLight, SceneObject, Viewpoint};
pub use source::Source;
pub use splats::Splats;
