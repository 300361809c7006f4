//! State of a fit, as a file. With its inputs and its configuration the fit goes on as if it had never
//! stopped, to the bit.
//!
//! Its parts ([`state_file`]): the caller's notes (UTF-8); iteration, last pause + 1 or 0, frozen splats and first count
//! (u32); the rows of all splats (parameters, first and second moments, gradient norm and cap of the scales).

use std::path::Path;

use bytemuck::{Pod, Zeroable};
use shaders_glsl::types::{History, SplatGrad};

use base::error::{Error, Kind, Result};
use base::state_file;
use splat::Splat;

const KIND: &str = "vgs-state-3";

/// Everything that a fit needs to go on, besides its inputs and its configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct FitState {
    /// Number of steps done.
    pub iteration: u32,
    /// The iteration before which the fit paused last, to change splats or intensities.
    pub(super) paused_at: Option<u32>,
    /// Number of updates left out so far because a gradient was not finite.
    pub(super) frozen: u32,
    /// Number of splats that the fit began with.
    pub(super) first_count: usize,
    /// Parameters in the fit's own units, and what the optimiser keeps of each splat.
    pub(super) rows: Vec<SplatRow>,
}

/// A splat in the fit's own units, and what the optimiser keeps of it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct SplatRow {
    pub splat: Splat,
    pub first: SplatGrad,
    pub second: SplatGrad,
    pub history: History,
}

impl FitState {
    /// Returns the number of splats.
    pub fn splat_count(&self) -> usize {
        self.rows.len()
    }

    /// Writes the state and the caller's `notes`, atomically. An existing file is refused unless `force` is
    /// true.
    pub fn write(&self, path: &Path, notes: &str, force: bool) -> Result<()> {
        let paused = self.paused_at.map_or(0, |k| k + 1);
        let words = [self.iteration, paused, self.frozen, self.first_count as u32];
        let parts = [notes.as_bytes(), bytemuck::cast_slice(&words), bytemuck::cast_slice(&self.rows)];
        state_file::write(path, KIND, &parts, force)
    }

    /// Reads a state and the notes that were written with it.
    pub fn read(path: &Path) -> Result<(FitState, String)> {
        state_file::read(path, KIND)?.and_then(parse).ok_or_else(|| {
            Error::new(Kind::BadData, "VGS-FIT-020", "this is not the state of a fit, or it is damaged")
                .file(path)
                .help("start the fit anew, without --resume")
        })
    }
}

fn parse([notes, words, rows]: [Vec<u8>; 3]) -> Option<(FitState, String)> {
    let words = bytemuck::try_pod_read_unaligned::<[u32; 4]>(&words).ok()?;
    let [iteration, paused, frozen, first_count] = words;
    let first_count = first_count as usize;
    let rows = rows.chunks_exact(size_of::<SplatRow>());
    if rows.len() == 0 || !rows.remainder().is_empty() {
        return None;
    }
    let rows = rows.map(bytemuck::pod_read_unaligned).collect();
    let state = FitState { iteration, paused_at: paused.checked_sub(1), frozen, first_count, rows };
    Some((state, String::from_utf8(notes).ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_comes_back_and_a_damaged_one_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.state");
        let rows = (0..5)
            .map(|i| SplatRow {
                splat: Splat { mean: [i as f32, 1e-42, f32::MAX], intensity: -0.0, ..Splat::default() },
                history: History { gradient_norm: 0.1 * i as f32, log_scale_cap: 1.0 },
                ..SplatRow::default()
            })
            .collect();
        let state = FitState { iteration: 7, paused_at: Some(0), frozen: 2, first_count: 4, rows };
        state.write(&path, "notes, größer", false).unwrap();
        let (back, notes) = FitState::read(&path).unwrap();
        assert_eq!((&back, notes.as_str()), (&state, "notes, größer"));
        let bits = |s: &FitState| s.rows.iter().map(|r| r.splat.mean.map(f32::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&back), bits(&state));

        let error = {
            std::fs::write(&path, b"ply\n").unwrap();
            FitState::read(&path).unwrap_err()
        };
        assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-FIT-020"));
        assert!(FitState::read(&folder.path().join("none")).is_err_and(|e| e.kind == Kind::Missing));
    }
}
