//! The program as its users run it: files in, files and words out.
#![forbid(unsafe_code)]

mod arrows;
mod bake;
mod batch;
mod blocks;
mod compare;
mod convert;
mod dicom;
mod eval;
mod failing_writes;
mod film;
mod goals;
mod host_memory;
mod interruptions;
mod manual;
mod pack;
mod page;
mod reference;
mod refusals;
mod render;
mod small_files;
mod support;
mod surroundings;
mod told;
mod view;
mod whole;
mod zarr;
