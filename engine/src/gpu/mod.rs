//! The Vulkan layer: device, memory, kernels, recorded passes. It knows Vulkan, never medicine.
//!
//! A program boots one [`Gpu`], allocates [`Buffer`]s from it (each with a name and a purpose), creates
//! [`Kernel`]s from compiled shaders and records passes with a [`Recorder`]. Barriers follow from the
//! declared reads and writes; nobody outside this folder writes one. Handles keep the device alive; the
//! deletion of a dropped buffer is deferred until the device has passed the last submission that may use it.
//!
//! | file | what is there |
//! |---|---|
//! | `boot` | options, [`Boot`], and the steps that lead to a [`Gpu`] |
//! | `instance` | the instance with its loader and its message catcher |
//! | `description` | devices as they describe themselves, and what they lack |
//! | `choice` | the choice of the device |
//! | `features` | extensions and features that are asked for, and turned on |
//! | `context`, `device` | everything that lives as long as the device, and the handle [`Gpu`] to it |
//! | `pipeline_cache` | compiled pipelines between two runs of a program |
//! | `check` | Vulkan results as errors |
//! | `memory` | the allocator, its account of bytes, deferred deletions |
//! | `buffer`, `image`, `format` | typed buffers, images, formats of texels |
//! | `external_image` | images of a swapchain, acquired for a frame and released after it |
//! | `pipeline`, `kernel`, `drawing` | pipelines in general, of a compute shader, of a vertex and a fragment shader |
//! | `recorder` | recording of commands |
//! | `hazards` | barriers, from the accesses since the last one |
//! | `image_commands` | clearing and copying images |
//! | `bindings` | the resources that a pass binds, checked against its shaders |
//! | `pass`, `draw_pass` | the description of a pass, and of a drawing |
//! | `submissions` | the queue, the submissions in flight on it, the wait for them |
//! | `timing` | device time by pass and by submission |
//! | `surface` | a window's surface and its swapchain |
//!
//! This is the one module of the engine with `unsafe` code. Three facts hold for all of it and are not
//! repeated at every call: handles passed to the device were created by it and are destroyed only after it
//! has finished with them (deferred deletion, or `device_wait_idle` at the end); create-info structs point to
//! locals that outlive the call; the queue, the allocator and the recorder slots are reached through one
//! mutex each.
#![allow(unsafe_code, reason = "calls into Vulkan; see the module text for the rules that hold throughout")]

mod bindings;
mod boot;
mod buffer;
mod check;
mod choice;
mod context;
mod description;
mod device;
mod draw_pass;
mod drawing;
mod external_image;
mod features;
mod format;
mod hazards;
mod image;
mod image_commands;
mod instance;
mod kernel;
mod memory;
mod pass;
mod pipeline;
mod pipeline_cache;
mod recorder;
mod submissions;
mod surface;
mod timing;

pub use boot::{Boot, GpuOptions, Windows};
pub use buffer::Buffer;
pub use description::{DeviceDescription, devices};
pub use device::{Gpu, Hitches, Limits};
pub use draw_pass::DrawPass;
pub use drawing::Drawing;
pub use format::Format;
pub use image::Image;
pub use kernel::Kernel;
pub use pass::Pass;
pub use recorder::Recorder;
pub use submissions::Ticket;
pub use surface::{Acquired, Surface};
pub use timing::PassTime;

use check::check;
use context::{Context, lock};
