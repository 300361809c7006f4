//! What is done to the splats of a file before they are used: limits are kept, and what cannot be used is dropped.

use std::path::Path;

use super::activation::{Activations, limit_anisotropy};
use super::{Field, Kernel, Splat, SplatSet, defect};
use base::error::{Error, Kind, Result};

/// What was done to the splats of a file.
#[derive(Clone, Debug, Default)]
pub struct Mended {
    /// Rows that are left; `None` if all are.
    pub kept: Option<Vec<usize>>,
    /// Number of splats that were dropped.
    pub dropped: usize,
    /// Number of splats that were thinner than their length allows.
    pub widened: usize,
}

impl Mended {
    /// Drops the splats of `set` that cannot be used, with what belongs to them; `defect_of` tells what is wrong with a
    /// row beside its splat and colours. If `strict` is set, the first unusable splat is an error.
    pub fn of(
        set: &mut SplatSet,
        defect_of: impl Fn(usize) -> Option<&'static str>,
        strict: bool,
    ) -> Result<Self> {
        let why = |i: usize| {
            let colour =
                || set.colours.as_ref().is_some_and(|colours| !colours.of(i).iter().all(|c| c.is_finite()));
            defect(&set.splats[i])
                .or_else(|| colour().then_some("a value is not finite"))
                .or_else(|| defect_of(i))
        };
        let count = set.splats.len();
        let first = (0..count).find_map(|i| Some((i, why(i)?)));
        if let Some((first, reason)) = first.filter(|_| strict) {
            let message = format!("splat {first} is unusable: {reason}");
            return Err(Error::new(Kind::BadData, "VGS-PLY-022", message));
        }
        let kept: Option<Vec<usize>> = first.map(|_| (0..count).filter(|&i| why(i).is_none()).collect());
        if let Some(kept) = &kept {
            set.take(kept);
        }
        Ok(Mended { dropped: count - set.splats.len(), widened: 0, kept })
    }

    /// Widens the splats that are too thin for their length, which must be in mm.
    pub fn widen(&mut self, splats: &mut [Splat]) {
        for splat in splats {
            let log_scale = limit_anisotropy(splat.log_scale);
            self.widened += usize::from(log_scale != splat.log_scale);
            splat.log_scale = log_scale;
        }
    }

    /// Warns of what was done to the splats of a file.
    pub fn tell(&self, path: &Path, set: &SplatSet) {
        let (file, dropped, widened) = (path.display(), self.dropped, self.widened);
        if dropped > 0 {
            tracing::warn!(%file, dropped, "unusable splats were dropped");
        }
        if widened > 0 {
            tracing::warn!(%file, widened, "splats thinner than 1/10000 of their length were widened");
        }
        if set.splats.is_empty() && set.voxels.is_empty() {
            tracing::warn!(%file, "the file holds no usable splat");
        }
        if !set.unit.is_physical() {
            tracing::info!(%file, "no intensity: what acts on intensities acts on the luminance of the colour");
        }
    }
}

/// Makes opacities of exactly 0 and 1, whose logits are infinite, those next to them: programs that go by
/// opacities of 8 bits write them.
pub fn bound_opacities(splats: &mut [Splat]) {
    for splat in splats.iter_mut().filter(|splat| splat.opacity_logit.is_infinite()) {
        splat.set_opacity(if splat.opacity_logit > 0.0 { 1.0 } else { 0.0 });
    }
}

/// Returns the field of splats of ordinary 3D Gaussian splatting: a Gaussian kernel and the mean intensity as
/// background.
pub fn ordinary_field(splats: &[Splat]) -> Field {
    let sum: f64 = splats.iter().map(|splat| f64::from(splat.intensity)).sum();
    let background = (sum / splats.len().max(1) as f64) as f32;
    Field { kernel: Kernel::Gaussian, background, ..Field::default() }
}

/// Returns `count` zeros, or an error if there is no memory for them.
pub fn zeros<T: bytemuck::Zeroable + Clone>(count: usize) -> Result<Vec<T>> {
    let mut all = Vec::new();
    reserve(&mut all, count)?;
    all.resize(count, T::zeroed());
    Ok(all)
}

/// Makes room for `more` rows, or fails if there is no memory for them: what a file claims may be
/// more than memory holds.
pub fn reserve<T>(all: &mut Vec<T>, more: usize) -> Result<()> {
    all.try_reserve_exact(more).map_err(|_| {
        let needed = more.saturating_mul(size_of::<T>());
        let message = format!("no memory for the splats: {needed} bytes more are needed");
        Error::new(Kind::HostMemory, "VGS-PLY-015", message)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_opacity_of_one_is_opaque_and_one_of_zero_is_transparent() {
        let of = |opacity_logit| Splat { opacity_logit, rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        let mut splats = [f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1.5].map(of);
        bound_opacities(&mut splats);
        assert!(splats[0].opacity() > 0.999_999 && splats[1].opacity() < 1e-6);
        assert!(splats[2].opacity_logit.is_nan() && splats[3].opacity_logit == 1.5);
        let mut set = SplatSet { splats: splats.to_vec(), ..SplatSet::default() };
        let error = Mended::of(&mut set.clone(), |_| None, true).expect_err("NaN");
        assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-PLY-022"));
        let mended = Mended::of(&mut set, |_| None, false).expect("the others");
        assert_eq!((mended.dropped, mended.kept), (1, Some(vec![0, 1, 3])));
        assert_eq!(set.splats.len(), 3);
    }
}
