//! The program on headsets: simulated ones, Monado, and what its hands, panels and frames do.
#![forbid(unsafe_code)]

mod compositor;
mod depth;
mod edges;
mod film_headset;
mod foveation;
mod hands;
mod monado;
mod pointing;
mod program;
mod simulated;
mod support;
mod telling;
