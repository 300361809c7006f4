//! State of a fit, as a file. With its inputs and its configuration the fit goes on as if it had never
//! stopped, to the bit.
//!
//! The file begins with a line that names the format. Then follow, little-endian: the length of the caller's
//! notes (u64) and the notes (UTF-8); iteration, last pause + 1 or 0, frozen splats and a reserved word (4 ×
//! u32); first count and count (2 × u64); the rows of all splats (parameters, first and second moments,
//! gradient norm and cap of the scales); and a CRC-32 of everything before it.

use std::io::Read;
use std::path::Path;

use bytemuck::{Pod, Zeroable};
use flate2::Crc;
use shaders_glsl::types::{History, SplatGrad};

use base::error::{Error, Kind, Result};
use base::output::write_atomic;
use splat::Splat;

const MAGIC: &[u8] = b"vgs-state-2\n";

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
        let mut bytes = MAGIC.to_vec();
        bytes.extend((notes.len() as u64).to_le_bytes());
        bytes.extend(notes.as_bytes());
        for word in [self.iteration, self.paused_at.map_or(0, |k| k + 1), self.frozen, 0] {
            bytes.extend(word.to_le_bytes());
        }
        for word in [self.first_count as u64, self.rows.len() as u64] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.extend(
            self.rows
                .iter()
                .flat_map(bytemuck::cast_ref::<SplatRow, [f32; ROW_WORDS]>)
                .flat_map(|v| v.to_le_bytes()),
        );
        let mut crc = Crc::new();
        crc.update(&bytes);
        bytes.extend(crc.sum().to_le_bytes());
        write_atomic(path, force, |out| out.write_all(&bytes))
    }

    /// Reads a state and the notes that were written with it.
    pub fn read(path: &Path) -> Result<(FitState, String)> {
        let mut bytes = Vec::new();
        base::input::open(path)
            .and_then(|mut file| file.read_to_end(&mut bytes))
            .map_err(|e| Error::io(path, "reading the state of a fit", &e))?;
        parse(&bytes).ok_or_else(|| {
            Error::new(Kind::BadData, "VGS-FIT-020", "this is not the state of a fit, or it is damaged")
                .file(path)
                .help("start the fit anew, without --resume")
        })
    }
}

const ROW_WORDS: usize = size_of::<SplatRow>() / size_of::<f32>();

/// Parses what [`FitState::write`] wrote; returns nothing if the bytes are not a state or are damaged.
fn parse(bytes: &[u8]) -> Option<(FitState, String)> {
    let (body, sum) = bytes.split_at_checked(bytes.len().checked_sub(4)?)?;
    let mut crc = Crc::new();
    crc.update(body);
    if crc.sum().to_le_bytes() != sum {
        return None;
    }
    let mut rest = body.strip_prefix(MAGIC)?;
    let mut take = |n: usize| {
        let (head, tail) = rest.split_at_checked(n)?;
        rest = tail;
        Some(head)
    };
    let long = |b: &[u8]| Some(u64::from_le_bytes(b.try_into().ok()?));
    let length = usize::try_from(long(take(8)?)?).ok()?;
    let notes = String::from_utf8(take(length)?.to_vec()).ok()?;
    let mut words = [0u32; 4];
    for word in &mut words {
        *word = u32::from_le_bytes(take(4)?.try_into().ok()?);
    }
    let first_count = usize::try_from(long(take(8)?)?).ok()?;
    let count = usize::try_from(long(take(8)?)?).ok()?;
    let payload = take(count.checked_mul(size_of::<SplatRow>())?)?;
    let numbers: Vec<f32> = payload.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
    let rows: Vec<SplatRow> =
        numbers.as_chunks::<ROW_WORDS>().0.iter().map(|row| *bytemuck::cast_ref(row)).collect();
    let [iteration, paused, frozen, _] = words;
    (rest.is_empty() && count > 0)
        .then(|| (FitState { iteration, paused_at: paused.checked_sub(1), frozen, first_count, rows }, notes))
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

        let whole = std::fs::read(&path).unwrap();
        for cut in [0, 3, MAGIC.len(), whole.len() / 2, whole.len() - 1] {
            assert!(parse(&whole[..cut]).is_none(), "cut at {cut}");
        }
        for at in [0, 20, 60, whole.len() - 1] {
            let mut bad = whole.clone();
            bad[at] ^= 1;
            assert!(parse(&bad).is_none(), "a bit at {at} has changed");
        }
        let error = {
            std::fs::write(&path, b"ply\n").unwrap();
            FitState::read(&path).unwrap_err()
        };
        assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-FIT-020"));
        assert!(FitState::read(&folder.path().join("none")).is_err_and(|e| e.kind == Kind::Missing));
    }
}
