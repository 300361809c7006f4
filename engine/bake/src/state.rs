//! What interrupted training needs to go on as if it had never stopped, to the bit, and its file.

use std::path::Path;

use bytemuck::Pod;
use shaders_glsl::types::{History, SplatGrad};

use base::error::{Error, Kind, Result};
use base::state_file;
use splat::Splat;

const KIND: &str = "vgs-bake-state-1";

/// How near the pictures come after some steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Steps that are done.
    pub step: u32,
    /// Time that they took, s.
    pub seconds: f64,
    /// Number of splats.
    pub splats: usize,
    /// Mean PSNR of the views that are not trained, dB.
    pub psnr_db: f64,
    /// The least of them, dB.
    pub worst_psnr_db: f64,
}

/// Training that broke off. The set that it began with, the views and the options are the caller's to keep.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BakeState {
    /// Steps that are done.
    pub steps: u32,
    /// Steps since Adam began.
    pub(super) adam_steps: u32,
    /// Times that splats were split.
    pub(super) grown: u32,
    /// Time that the steps took, s.
    pub(super) seconds: f64,
    /// PSNR of the beginning, view by view, dB.
    pub(super) before: Vec<f64>,
    pub(super) curve: Vec<CurvePoint>,
    pub(super) splats: Trainees,
}

/// Splats that are trained, with what Adam keeps of them, in the space of the training.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Trainees {
    /// Rows of the set of the beginning.
    pub rows: Vec<u32>,
    pub splats: Vec<Splat>,
    pub first: Vec<SplatGrad>,
    pub second: Vec<SplatGrad>,
    pub histories: Vec<History>,
    /// Coefficients, by splat and coefficient, and their first and second moments.
    pub harmonics: [Vec<[f32; 3]>; 3],
}

impl Trainees {
    /// Returns true if these are splats of a set of `count`, with so many coefficients each.
    pub fn belong_to(&self, count: usize, coefficients: usize) -> bool {
        let own = self.splats.len();
        own > 0
            && [self.rows.len(), self.first.len(), self.second.len(), self.histories.len()] == [own; 4]
            && self.harmonics.iter().all(|rows| rows.len() == own * coefficients)
            && self.rows.iter().all(|&row| (row as usize) < count)
    }
}

impl BakeState {
    /// Writes the state and the caller's `notes`, atomically.
    ///
    /// # Errors
    /// Those of [`state_file::write`].
    pub fn write(&self, path: &Path, notes: &str, force: bool) -> Result<()> {
        let counts = [self.steps, self.adam_steps, self.grown].map(f64::from);
        let point =
            |p: &CurvePoint| [f64::from(p.step), p.seconds, p.splats as f64, p.psnr_db, p.worst_psnr_db];
        let curve: Vec<[f64; 5]> = self.curve.iter().map(point).collect();
        let Trainees { rows, splats, first, second, histories, harmonics: [own, mean, square] } =
            &self.splats;
        let parts = [
            notes.as_bytes(),
            bytemuck::cast_slice(&counts),
            bytemuck::bytes_of(&self.seconds),
            bytemuck::cast_slice(&self.before),
            bytemuck::cast_slice(&curve),
            bytemuck::cast_slice(rows),
            bytemuck::cast_slice(splats),
            bytemuck::cast_slice(first),
            bytemuck::cast_slice(second),
            bytemuck::cast_slice(histories),
            bytemuck::cast_slice(own),
            bytemuck::cast_slice(mean),
            bytemuck::cast_slice(square),
        ];
        state_file::write(path, KIND, &parts, force)
    }

    /// Reads a state and the notes that were written with it.
    ///
    /// # Errors
    /// Those of reading, and [`Kind::BadData`] for a file that is something else, or damaged.
    pub fn read(path: &Path) -> Result<(BakeState, String)> {
        state_file::read(path, KIND)?.and_then(parse).ok_or_else(|| {
            Error::new(Kind::BadData, "VGS-BAKE-005", "this is not the state of baking, or it is damaged")
                .file(path)
                .help("bake anew, without --resume")
        })
    }
}

fn parse(parts: [Vec<u8>; 13]) -> Option<(BakeState, String)> {
    let [notes, counts, seconds, before, curve, parts @ ..] = parts;
    let [rows, splats, first, second, histories, own, mean, square] = parts;
    let &[steps, adam_steps, grown] = &of_bytes::<f64>(&counts)?[..] else { return None };
    let &[seconds] = &of_bytes::<f64>(&seconds)?[..] else { return None };
    let point = |[step, seconds, splats, psnr_db, worst_psnr_db]: [f64; 5]| CurvePoint {
        step: step as u32,
        seconds,
        splats: splats as usize,
        psnr_db,
        worst_psnr_db,
    };
    let state = BakeState {
        steps: steps as u32,
        adam_steps: adam_steps as u32,
        grown: grown as u32,
        seconds,
        before: of_bytes(&before)?,
        curve: of_bytes(&curve)?.into_iter().map(point).collect(),
        splats: Trainees {
            rows: of_bytes(&rows)?,
            splats: of_bytes(&splats)?,
            first: of_bytes(&first)?,
            second: of_bytes(&second)?,
            histories: of_bytes(&histories)?,
            harmonics: [of_bytes(&own)?, of_bytes(&mean)?, of_bytes(&square)?],
        },
    };
    Some((state, String::from_utf8(notes).ok()?))
}

fn of_bytes<T: Pod>(bytes: &[u8]) -> Option<Vec<T>> {
    let rows = bytes.chunks_exact(size_of::<T>());
    rows.remainder().is_empty().then(|| rows.map(bytemuck::pod_read_unaligned).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_comes_back_and_something_else_does_not() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.state");
        let splats = Trainees {
            rows: vec![0, 4],
            splats: vec![Splat { mean: [-0.0, 1e-42, f32::MAX], ..Splat::default() }; 2],
            first: vec![SplatGrad::default(); 2],
            second: vec![SplatGrad { opacity_logit: 3.0, ..SplatGrad::default() }; 2],
            histories: vec![History { gradient_norm: 0.1, log_scale_cap: 1.0 }; 2],
            harmonics: [vec![[1.0, 2.0, 3.0]; 8], vec![[0.0; 3]; 8], vec![[4.0; 3]; 8]],
        };
        for (belong, count, coefficients) in [(true, 5, 4), (false, 4, 4), (false, 5, 9)] {
            assert_eq!(splats.belong_to(count, coefficients), belong);
        }
        let point = CurvePoint { step: 7, seconds: 0.1, splats: 2, psnr_db: 30.5, worst_psnr_db: 29.1 };
        let state = BakeState {
            steps: 80,
            adam_steps: 3,
            grown: 2,
            seconds: 1.5,
            before: vec![20.0, f64::INFINITY],
            curve: vec![point; 2],
            splats,
        };
        state.write(&path, "größer", false).expect("written");
        let (back, notes) = BakeState::read(&path).expect("read");
        assert_eq!((&back, notes.as_str()), (&state, "größer"));
        assert_eq!(back.splats.splats[0].mean[0].to_bits(), (-0.0f32).to_bits());
        std::fs::write(&path, b"vgs-state-3\n").expect("written");
        let error = BakeState::read(&path).expect_err("something else");
        assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-BAKE-005"));
    }
}
