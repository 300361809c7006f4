//! The engine on a device: kernels beside their references, fits, pictures, and what happens at extremes.
#![forbid(unsafe_code)]

mod alpha;
mod beside;
mod coarse;
mod coded;
mod decoded;
mod decoded_real;
mod descriptors;
mod errors;
mod extremes;
mod fidelity;
mod fit;
mod frames;
mod goal;
mod golden;
mod gradients;
mod losses;
mod memory;
mod objects;
mod options;
mod oracle;
mod packed;
mod profiles;
mod properties;
mod rays;
mod real;
mod render;
mod shapes;
mod slices;
mod sorting;
mod storage;
mod subset;
mod topology;
mod volume_mode;
mod window;
mod work;
