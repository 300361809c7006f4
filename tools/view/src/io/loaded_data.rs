//! Data that were read, on the host: splats, the volume, and what was computed from them.

use std::sync::Arc;

use engine::Result;
use engine::fidelity::ShownError;
use engine::gpu::Gpu;
use engine::render::{DecodeOptions, Decoding, Look, Probe, Scene, SplatKind};
use engine::splat::SplatSet;
use engine::unit::Unit;
use glam::DVec3;

use crate::io::loader::{Loaded, LoadedSplats, LoadedVolume, Remaining};
use crate::model::deletions::Deletion;
use crate::model::histogram::Histogram;
use crate::model::panel_info::Measured;
use crate::model::state::{Subject, ViewState};

/// Splats, a volume, and the error of one against the other.
type Compared = (Arc<LoadedSplats>, Arc<LoadedVolume>, Option<Arc<ShownError>>);

/// Data that were read.
#[derive(Default)]
pub struct LoadedData {
    /// Splats of all files, also those that are deleted.
    pub splats: Option<Arc<LoadedSplats>>,
    /// Splats of all files that deletions have left, and these; `None` while nothing was deleted.
    left: Option<(Vec<Deletion>, Arc<LoadedSplats>)>,
    /// True while splats of files are not shown because those that are deleted are still being found.
    pub waits: bool,
    /// Splats of a fit that no file has yet; they are shown in place of those of the files.
    pub fitted: Option<Arc<LoadedSplats>>,
    /// Splats that are compared with those.
    pub beside: Option<Arc<LoadedSplats>>,
    /// Volume.
    pub volume: Option<Arc<LoadedVolume>>,
    /// Histogram of the splats' intensities.
    pub splat_histogram: Option<Histogram>,
    /// Histogram of the volume's intensities within its region.
    pub volume_histogram: Option<Histogram>,
    /// Error of splats of files against a volume, as last measured; `None` within it if they lie nowhere in it, or if it
    /// could not be measured.
    error: Option<Compared>,
    /// Probe that evaluates the splats' field at points.
    probe: Option<Probe>,
    /// Probe of the splats beside them.
    probe_beside: Option<Probe>,
}

impl LoadedData {
    /// Takes loaded data. Returns the subject that has to be shown anew, or the error of what could not be
    /// loaded.
    pub fn take(&mut self, loaded: Loaded) -> Result<Option<Subject>> {
        match loaded {
            Loaded::Splats(splats) => {
                (self.splats, self.left) = (Some(splats), None);
                (self.splat_histogram, self.probe) = (None, None);
                return Ok(Some(Subject::Splats));
            }
            Loaded::Beside(splats) => {
                (self.beside, self.probe_beside) = (Some(splats), None);
                return Ok(Some(Subject::Beside));
            }
            Loaded::Volume(shown) => {
                self.volume = Some(shown);
                self.volume_histogram = None;
                return Ok(Some(Subject::Volume));
            }
            Loaded::Remaining(left) => {
                // Other files may have been read meanwhile.
                if self.splats.as_ref().is_some_and(|splats| Arc::ptr_eq(splats, &left.whole)) {
                    let Remaining { deleted, splats, .. } = left;
                    self.left = Some((deleted, splats));
                    (self.splat_histogram, self.probe, self.waits) = (None, None, false);
                    return Ok(Some(Subject::Splats));
                }
            }
            Loaded::Counted(splats, histogram, probe) => {
                if self.remaining_splats().is_some_and(|left| Arc::ptr_eq(left, &splats)) {
                    (self.splat_histogram, self.probe) = (histogram, Some(*probe));
                } else if self.beside.as_ref().is_some_and(|beside| Arc::ptr_eq(beside, &splats)) {
                    self.probe_beside = Some(*probe);
                }
            }
            Loaded::VolumeHistogram(volume, histogram) => {
                if self.volume.as_ref().is_some_and(|own| Arc::ptr_eq(own, &volume)) {
                    self.volume_histogram = histogram;
                }
            }
            Loaded::Error(splats, volume, measured) => {
                let (found, failed) = match measured {
                    Ok(found) => (found, None),
                    Err(error) => (None, Some(error)),
                };
                self.error = Some((splats, volume, found));
                return failed.map_or(Ok(None), Err);
            }
            Loaded::Edges(_) | Loaded::Written(..) | Loaded::Sorted(..) | Loaded::Several(_) => {}
            Loaded::Failed(_, error) => return Err(error),
        }
        Ok(None)
    }

    /// Drops the data of a subject.
    pub fn forget(&mut self, subject: Subject) {
        match subject {
            Subject::Splats => {
                (self.splats, self.left, self.waits) = (None, None, false);
                (self.splat_histogram, self.probe) = (None, None);
            }
            Subject::Beside => (self.beside, self.probe_beside) = (None, None),
            Subject::Volume => (self.volume, self.volume_histogram) = (None, None),
        }
    }

    /// Returns the same splats and volume, shared and not copied, without histograms and probes.
    pub fn sources(&self) -> Self {
        LoadedData {
            splats: self.splats.clone(),
            left: self.left.clone(),
            waits: self.waits,
            fitted: self.fitted.clone(),
            beside: self.beside.clone(),
            volume: self.volume.clone(),
            error: self.error.clone(),
            ..LoadedData::default()
        }
    }

    /// Returns splats and volume whose error can be measured: those of files, with intensities.
    fn comparable(&self) -> Option<(&Arc<LoadedSplats>, &Arc<LoadedVolume>)> {
        let splats = self.splats.as_ref().filter(|splats| {
            self.fitted.is_none() && splats.set.colours.is_none() && !splats.set.is_empty()
        })?;
        Some((splats, self.volume.as_ref()?))
    }

    /// Returns what was measured of what is open now.
    fn measured(&self) -> Option<&Option<Arc<ShownError>>> {
        let (splats, volume) = self.comparable()?;
        let (of_splats, of_volume, error) = self.error.as_ref()?;
        (Arc::ptr_eq(splats, of_splats) && Arc::ptr_eq(volume, of_volume)).then_some(error)
    }

    /// Returns splats and volume whose error has not been measured.
    pub fn to_measure(&self) -> Option<(Arc<LoadedSplats>, Arc<LoadedVolume>)> {
        let (splats, volume) = self.comparable().filter(|_| self.measured().is_none())?;
        Some((Arc::clone(splats), Arc::clone(volume)))
    }

    /// Returns the error of the splats against the volume, if it was measured.
    pub fn error_found(&self) -> Option<&ShownError> {
        self.measured()?.as_deref()
    }

    /// Returns the error of the splats against the volume, as far as it is known.
    pub fn error(&self) -> Measured<'_> {
        match (self.comparable(), self.measured()) {
            (None, _) => Measured::Nothing,
            (Some(_), None) => Measured::Later,
            (Some(_), Some(None)) => Measured::Nowhere,
            (Some(_), Some(Some(error))) => Measured::Found(error),
        }
    }

    /// Returns true if the splats are to be shown in the colours of their error.
    pub fn shows_error(&self, state: &ViewState) -> bool {
        state.errors.picture && self.error_found().is_some() && self.set(Subject::Splats).is_some()
    }

    /// Creates the scene of the splats in the colours of their error, and what has to be done before mode decoded shows
    /// them; `None` if there is no error.
    pub fn error_scene(
        &self,
        gpu: &Gpu,
        state: &ViewState,
        decoding: DecodeOptions,
    ) -> Result<Option<(Scene, Decoding)>> {
        let (Some(Some(error)), Some(set)) = (self.measured(), self.set(Subject::Splats)) else {
            return Ok(None);
        };
        let look = error.look(&self.look(Subject::Splats, state)?, state.errors.range(error));
        let scene = Scene::new(gpu, Some(set), None, &look)?;
        let Some(splats) = &scene.splats else { return Ok(None) };
        let (error, origin) = (Arc::clone(error), scene.origin);
        let decoding = splats.decoding_objects(gpu, decoding, move |at| error.class(at + origin))?;
        Ok(Some((scene, decoding)))
    }

    /// Returns true if there are data of a subject.
    pub fn has(&self, subject: Subject) -> bool {
        match subject {
            Subject::Splats | Subject::Beside => self.set(subject).is_some(),
            Subject::Volume => self.volume.is_some(),
        }
    }

    /// Returns the splats of a subject; `None` if there are none.
    pub fn set(&self, subject: Subject) -> Option<&SplatSet> {
        let splats = match subject {
            Subject::Splats => self.shown_splats(),
            Subject::Beside => self.beside.as_ref(),
            Subject::Volume => None,
        };
        splats.map(|splats| &splats.set).filter(|set| !set.is_empty())
    }

    /// Returns the only mode that shows the splats beside the others; `None` if every mode does.
    pub fn own_mode_beside(&self) -> Option<&'static str> {
        SplatKind::of(self.set(Subject::Beside)?).own_mode()
    }

    /// Returns the mode in which a subject is shown at rest: the user's choice, unless splats beside the others
    /// can be shown in one mode only.
    pub fn mode_of(&self, subject: Subject, state: &ViewState) -> &'static str {
        let own = self.own_mode_beside().filter(|_| subject == Subject::Beside);
        own.unwrap_or(state.mode_of(subject))
    }

    /// Returns the splats that are shown: those of the fit, or what is left of those of the files.
    pub fn shown_splats(&self) -> Option<&Arc<LoadedSplats>> {
        self.fitted.as_ref().or(self.remaining_splats().filter(|_| !self.waits))
    }

    /// Returns the splats of all files that deletions have left.
    pub fn remaining_splats(&self) -> Option<&Arc<LoadedSplats>> {
        self.left.as_ref().map(|(_, splats)| splats).or(self.splats.as_ref())
    }

    /// Returns the deletions that [`LoadedData::remaining_splats`] are left by.
    pub fn deleted(&self) -> &[Deletion] {
        self.left.as_ref().map_or(&[], |(deleted, _)| deleted)
    }

    /// Returns the number of splats that are deleted.
    pub fn deleted_count(&self) -> usize {
        let count = |splats: Option<&Arc<LoadedSplats>>| splats.map_or(0, |splats| splats.set.splats.len());
        count(self.splats.as_ref()) - count(self.remaining_splats())
    }

    /// Returns the least and greatest intensity of splats and volume.
    pub fn range(&self) -> [f64; 2] {
        let sets = Subject::SETS.into_iter().filter_map(|subject| self.set(subject));
        let splats = sets.flat_map(|set| &set.splats).map(|s| f64::from(s.intensity));
        let volume = self.volume.iter().filter_map(|v| v.volume.min_max());
        let ends = volume.flat_map(|(low, high)| [f64::from(low), f64::from(high)]);
        let all = splats.chain(ends).filter(|c| c.is_finite());
        let wider =
            |range: Option<[f64; 2]>, c: f64| Some(range.map_or([c, c], |[a, b]| [a.min(c), b.max(c)]));
        all.fold(None, wider).unwrap_or([0.0, 1.0])
    }

    /// Returns true if the orientation of the patient is known.
    pub fn oriented(&self) -> bool {
        self.volume.as_ref().is_none_or(|v| v.volume.oriented)
    }

    /// Returns what intensities are numbers of, as far as is known.
    pub fn unit(&self) -> Unit {
        match &self.volume {
            Some(shown) => shown.volume.unit(),
            None => self.set(Subject::Splats).map(|set| set.unit).unwrap_or_default(),
        }
    }

    /// Returns the intensity at a point (mm RAS) of the volume, or of the field of a subject's splats if there is no
    /// volume; `None` outside.
    pub fn sample(&self, subject: Subject, at_mm: DVec3) -> Option<f64> {
        if self.volume.is_none() {
            let probe = if subject == Subject::Beside { &self.probe_beside } else { &self.probe };
            return probe.as_ref()?.at(at_mm).map(|reading| reading.intensity);
        }
        self.sample_whole(at_mm).filter(|(_, weight)| *weight > 0.0).map(|(intensity, _)| intensity)
    }

    /// Returns the intensity at a point (mm RAS) of the whole volume, and the weight of its region there (1 without
    /// a region); `None` outside, or without a volume.
    pub fn sample_whole(&self, at_mm: DVec3) -> Option<(f64, f64)> {
        let LoadedVolume { volume, roi, .. } = self.volume.as_deref()?;
        let voxel = volume.voxel_from_world().transform_point3(at_mm);
        let last = DVec3::from_array(volume.size.map(|n| n as f64 - 0.5));
        let inside = voxel.cmpge(DVec3::splat(-0.5)).all() && voxel.cmple(last).all();
        inside.then(|| (volume.trilinear(voxel), roi.as_ref().map_or(1.0, |roi| roi.trilinear(voxel))))
    }

    /// Returns two corners of the box around all voxels of the volume, mm RAS.
    pub fn volume_bounds(&self) -> Option<[DVec3; 2]> {
        let corners = self.volume.as_ref()?.volume.world_corners();
        Some(corners.into_iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], corner| {
            [low.min(corner), high.max(corner)]
        }))
    }

    /// Returns the look of a subject.
    ///
    /// # Errors
    /// Returns the errors of [`ViewState::look`].
    pub fn look(&self, subject: Subject, state: &ViewState) -> Result<Look> {
        // The rows of the list of objects are those of files.
        let of_files = subject == Subject::Splats && self.fitted.is_none();
        let splats = self.splats.as_ref().filter(|_| of_files);
        let numbers: Vec<u8> = splats.iter().flat_map(|s| &s.objects).map(|(_, number, _)| *number).collect();
        state.look(&numbers)
    }

    /// Creates the scene of splats of a fit, with the look that they have in place of those of the files.
    pub fn scene_of_fit(&self, gpu: &Gpu, splats: &LoadedSplats, state: &ViewState) -> Result<Scene> {
        let mut scene = Scene::new(gpu, Some(&splats.set), None, &state.look(&[])?)?;
        set_budget(&mut scene, state)?;
        Ok(scene)
    }

    /// Creates the scene of a subject; `None` if there are no data of it.
    pub fn scene(&self, gpu: &Gpu, subject: Subject, state: &ViewState) -> Result<Option<Scene>> {
        let look = self.look(subject, state)?;
        let splats = self.set(subject);
        let of_volume = self.volume.as_ref().filter(|_| subject == Subject::Volume);
        // Other edges than those of the state are better than none.
        let shown = of_volume.map(|volume| volume.latest().unwrap_or_else(|| volume.shown(state.edges)));
        let volume = of_volume.zip(shown.as_deref()).map(|(volume, shown)| volume.source(shown));
        if splats.is_none() && volume.is_none() {
            return Ok(None);
        }
        let mut scene = Scene::new(gpu, splats, volume.as_ref(), &look)?;
        set_budget(&mut scene, state)?;
        Ok(Some(scene))
    }
}

fn set_budget(scene: &mut Scene, state: &ViewState) -> Result<()> {
    match state.quality.splat_budget {
        Some(budget) => scene.set_splat_budget(Some(budget as usize)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use engine::splat::{Form, Splat};

    use super::*;
    use crate::model::state::SplatMode;

    fn loaded(intensity: f32, form: Form) -> Loaded {
        let splat = Splat { rotation: [1.0, 0.0, 0.0, 0.0], intensity, ..Splat::default() };
        let set = SplatSet { splats: vec![splat], form, ..SplatSet::default() };
        let splats = LoadedSplats::join(vec![("coarse.vgs".into(), set)]).expect("a set");
        Loaded::Beside(Arc::new(splats))
    }

    #[test]
    fn splats_beside_others_have_a_mode_of_their_own_where_they_need_one() {
        let mut state =
            ViewState::new(&engine::transfer::load("CT-Bone", [-1000.0, 2000.0]).expect("a preset"));
        let mut data = LoadedData::default();
        let modes = |data: &LoadedData, state: &ViewState| Subject::ALL.map(|s| data.mode_of(s, state));
        assert!(!data.has(Subject::Beside));
        assert_eq!(modes(&data, &state), ["decoded", "decoded", "volume"]);
        assert_eq!(data.take(loaded(300.0, Form::Field)).expect("taken"), Some(Subject::Beside));
        assert!(data.has(Subject::Beside) && !data.has(Subject::Splats));
        state.mode = SplatMode::named("exact").expect("a mode");
        assert_eq!(modes(&data, &state), ["exact", "exact", "volume"]);
        assert_eq!(data.range(), [300.0, 300.0]);
        data.take(loaded(300.0, Form::Grid)).expect("taken");
        assert_eq!(modes(&data, &state), ["exact", "decoded", "volume"]);
        assert_eq!(modes(&data.sources(), &state), ["exact", "decoded", "volume"], "in pictures, too");
        // They have no rows in the list of objects.
        state.objects = vec![crate::model::state::Object::new(0, None, "fine")];
        assert!(data.look(Subject::Beside, &state).expect("a look").objects.is_empty());
        data.forget(Subject::Beside);
        assert!(!data.has(Subject::Beside) && !data.sources().has(Subject::Beside));
    }
}
