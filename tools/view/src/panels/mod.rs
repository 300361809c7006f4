//! The panels: one function each, over plain data. What a panel cannot do by itself it asks for by an
//! [`Action`](crate::Action).
//!
//! | file | panel |
//! |---|---|
//! | `menu`, `status` | the menus above, the line below |
//! | `objects`, `transfer`, `quality`, `camera`, `clip`, `measure` | the sections at the side |
//! | `error` | the section of the error against the volume |
//! | `light` | where light comes from, and how surfaces respond to it |
//! | `edges` | how the edges of a binary region are shown |
//! | `fit` | the section that fits splats to a region of the volume |
//! | `slices` | the slices beside the picture |
//! | `welcome`, `notice`, `messages`, `keys`, `overlay` | over the picture: nothing open, a question, messages, keys, frame times |
//! | `series` | which of several series is meant |
//! | `annotations`, `handles` | over the picture: distances and names; what planes are dragged by |
//! | `editor` | the curve of the transfer function |
//! | `prompt` | asks for a file |
//! | `theme` | colours and sizes |
//! | `missing` | where the missing files of a session are |
//! | `widgets` | parts of the panels |

pub mod annotations;
pub mod camera;
pub mod clip;
pub mod edges;
pub mod editor;
pub mod error;
pub mod fit;
pub mod handles;
pub mod keys;
pub mod light;
pub mod measure;
pub mod menu;
pub mod messages;
pub mod missing;
pub mod notice;
pub mod objects;
pub mod overlay;
pub mod prompt;
pub mod quality;
pub mod series;
pub mod slices;
pub mod status;
pub mod theme;
pub mod transfer;
pub mod welcome;
pub(crate) mod widgets;
