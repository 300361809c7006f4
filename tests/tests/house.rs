//! What can be told from sources, documents and small programs: no device computes much here.
#![forbid(unsafe_code)]

mod arrows;
mod documentation;
mod error_codes;
mod examples;
mod fields;
mod outsiders;
mod reliability;
