//! The Vulkan layer: device, memory, kernels, recorded passes. It knows Vulkan, never medicine.
//!
//! A program boots one [`Gpu`], allocates [`Buffer`]s from it (each with a name and a purpose), creates
//! [`Kernel`]s from compiled shaders and records passes with a [`Recorder`]. Barriers follow from the
//! declared reads and writes; nobody outside this folder writes one. Handles keep the device alive; the
//! deletion of a dropped buffer is deferred until the device has passed the last submission that may use it.
//!
//! The layers, lowest first. A file uses files that stand before it in this table, never later ones, be it by
//! name or by method. So the context does not know who works on it; and a part of a type lies in a later file
//! of its own (`submit` of `recorder`, `image_content` of `image`) if it needs what comes between them.
//!
//! | file | what is there |
//! |---|---|
//! | | **helpers and plain data** |
//! | `check`, `lock`, `c_name` | Vulkan results as errors, locks of mutexes, names as Vulkan takes them |
//! | `format`, `ticket` | formats of texels, tickets of submissions |
//! | `fault` | a call of the driver that fails, for tests; with the feature `fault` |
//! | `message_log` | messages of the validation layers |
//! | `recipe` | all that a driver needs to compile a pipeline |
//! | `heap` | heaps of memory, and what is free in them |
//! | `limits`, `hitches`, `pass_time` | limits of a device, counts of hitches, the time of a pass |
//! | `windows`, `gpu_options` | what an instance must know of windows, and the options of booting |
//! | `features` | features that are asked for, and turned on |
//! | `device_description`, `choice` | devices as they describe themselves; the choice of one |
//! | | **an instance** |
//! | `boot` | [`Boot`], the creator of instance and device, and the engine itself as one |
//! | `instance`, `devices` | the instance with its loader and its message catcher; its devices |
//! | | **state that contexts and recorders own** |
//! | `memory` | the allocator, its account of bytes, deferred deletions |
//! | `pipeline`, `pipeline_cache` | pipelines while the device lives, and between two runs of a program |
//! | `pipeline_creation` | layouts and modules of pipelines in general |
//! | `descriptors` | sets of descriptors for devices that do not take them pushed |
//! | `submissions`, `times` | the queue, the submissions in flight on it, the times of finished ones |
//! | `hazards` | the accesses since the last barrier, and the barrier that follows from them |
//! | | **a device** |
//! | `context`, `gpu` | everything that lives as long as the device, and the handle [`Gpu`] to it |
//! | `booting` | the steps that lead to a [`Gpu`] |
//! | `waiting`, `timing` | the wait for submissions; device time by pass and by submission |
//! | | **what passes use** |
//! | `placement` | memory for a new object |
//! | `buffer`, `image` | typed buffers, and images |
//! | `bindings` | the resources that a pass binds, checked against its shaders |
//! | `kernel`, `drawing` | pipelines of a compute shader, of a vertex and a fragment shader |
//! | `compiler` | a device that compiles and never runs, for what its compiler says |
//! | | **recording** |
//! | `recorder`, `submit` | recording of commands, with the barriers between them; their submission |
//! | `image_commands` | clearing and copying images |
//! | `pass`, `draw_pass` | the description of a pass, and of a drawing |
//! | `buffer_content`, `image_content` | new buffers and images; writing and reading by the host |
//! | `upload_ring` | writing by the host without a wait, for what changes often |
//! | `external_image` | images of a swapchain, acquired for a frame and released after it |
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
mod booting;
mod buffer;
mod buffer_content;
mod c_name;
mod check;
mod choice;
mod compiler;
mod context;
mod descriptors;
mod device_description;
mod devices;
mod draw_pass;
mod drawing;
mod external_image;
#[cfg(feature = "fault")]
mod fault;
mod features;
mod format;
mod gpu;
mod gpu_options;
mod hazards;
mod heap;
mod hitches;
mod image;
mod image_commands;
mod image_content;
mod instance;
mod kernel;
mod limits;
mod lock;
mod memory;
mod message_log;
mod pass;
mod pass_time;
mod pipeline;
mod pipeline_cache;
mod pipeline_creation;
mod placement;
mod recipe;
mod recorder;
mod submissions;
mod submit;
mod surface;
mod ticket;
mod times;
mod timing;
mod upload_ring;
mod waiting;
mod windows;

pub use boot::Boot;
pub use buffer::Buffer;
pub use compiler::{Compiler, Executable};
pub use device_description::DeviceDescription;
pub use devices::devices;
pub use draw_pass::DrawPass;
pub use drawing::Drawing;
#[cfg(feature = "fault")]
pub use fault::{Call, Failure, Fault};
pub use format::Format;
pub use gpu::Gpu;
pub use gpu_options::GpuOptions;
pub use heap::{Heap, HeapKind};
pub use hitches::Hitches;
pub use image::Image;
pub use kernel::Kernel;
pub use limits::Limits;
pub use message_log::MessageLog;
pub use pass::Pass;
pub use pass_time::PassTime;
pub use recipe::{Overlap, Recipe, Targets};
pub use recorder::Recorder;
pub use surface::{Acquired, Surface};
pub use ticket::Ticket;
pub use upload_ring::UploadRing;
pub use windows::Windows;

use check::check;
use context::Context;
use lock::lock;
