//! The modes in which splats are shown, and what is made beside the window for them: the field that mode decoded
//! shows, and what moves fast.

use std::sync::Arc;

use engine::Result;
use engine::render::{DecodeOptions, GpuSplats, MEANWHILE, Needs, quality_levels};

use super::viewer::Viewer;
use crate::io::loader::EDGING;
use crate::model::state::{DECODED, Subject, mode_row};
use crate::screen::canvas::Canvas;

/// Returns the name of the work without which splats cannot be shown decoded.
fn decoding(subject: Subject) -> &'static str {
    if subject == Subject::Beside { "decoding the field to compare with" } else { "decoding the field" }
}

impl Viewer {
    /// Returns the mode in which a subject is wanted at rest; the colours of the error are those of voxels.
    pub(super) fn wanted_mode(&self, subject: Subject) -> &'static str {
        match subject {
            Subject::Splats if self.error_shown => DECODED,
            _ => self.data.mode_of(subject, &self.app.state),
        }
    }

    /// Returns the mode in which a subject is shown at rest: the one that is wanted, or slabs while the field is not
    /// decoded that it needs.
    pub(super) fn chosen_mode(&mut self, canvas: &Canvas, subject: Subject) -> &'static str {
        let wanted = self.wanted_mode(subject);
        let splats = canvas.splats_of(subject).filter(|_| mode_row(wanted).needs == Needs::DecodedField);
        let Some(splats) = splats else { return wanted };
        // Other edges than those of the state are better than none.
        let Some(there) = splats.decoded_as() else { return MEANWHILE };
        if self.decoding.get(&subject) == Some(&there) {
            self.decoding.remove(&subject);
            self.stale = true;
        }
        wanted
    }

    /// Returns how the field is decoded that a subject is shown by: as the state says, or as it is until that is there.
    pub(super) fn shown_decoding(&self, canvas: &Canvas, subject: Subject) -> DecodeOptions {
        if subject == Subject::Splats && self.error_shown {
            return DecodeOptions::default();
        }
        let there = canvas.splats_of(subject).and_then(GpuSplats::decoded_as);
        there.unwrap_or(self.app.state.decoding())
    }

    /// Returns true if a subject is shown by a field that is decoded otherwise than the state says.
    pub(super) fn lacks_edges(&self, canvas: &Canvas, subject: Subject) -> bool {
        self.shown_decoding(canvas, subject).edges != self.app.state.edges
            && mode_row(self.wanted_mode(subject)).needs == Needs::DecodedField
            && !(subject == Subject::Splats && self.error_shown)
    }

    /// Returns true if a subject is shown by a field in too little memory for all of it, whose bricks are whole elsewhere.
    pub(super) fn lacks_detail(&self, canvas: &Canvas, subject: Subject) -> bool {
        let wanted = self.app.state.decoding();
        wanted.budget.is_some()
            && canvas.splats_of(subject).and_then(GpuSplats::decoded_as).is_some_and(|there| there != wanted)
    }

    /// Returns true if the mode in which a subject is wanted is still to come, and `chosen` is shown meanwhile.
    pub(super) fn waits_for(&self, subject: Subject, chosen: &str) -> bool {
        chosen != self.wanted_mode(subject)
            && (!self.decoding.contains_key(&subject) || self.loader.is_doing(decoding(subject)))
    }

    /// Returns true if a mode of the quality levels shows a subject rightly and can render it at once.
    pub(super) fn moves_in(&self, canvas: &Canvas, subject: Subject, mode: &str) -> bool {
        let is_right = self.own_mode(subject).is_none_or(|own| own == mode);
        let is_prepared = |splats: &GpuSplats| {
            mode_row(mode).needs.are_met(splats, splats.decoded_as().unwrap_or_default())
        };
        is_right && canvas.splats_of(subject).is_some_and(is_prepared)
    }

    /// Begins to decode the field of a subject, beside the window, unless that has begun before; one after the other.
    pub(super) fn decode(&mut self, canvas: &Canvas, subject: Subject) -> Result<()> {
        let Some(splats) = canvas.splats_of(subject) else { return Ok(()) };
        let wanted = self.app.state.decoding();
        let others = self.decoding.contains_key(&subject) && self.loader.is_doing(decoding(subject));
        if !others && self.decoding.insert(subject, wanted) != Some(wanted) {
            self.loader.prepare(decoding(subject), splats.decoding(canvas.gpu(), wanted)?);
        }
        Ok(())
    }

    /// Begins to make what is shown of the volume with the edges of the state, beside the window, if that is still to
    /// come.
    pub(super) fn edge_volume(&mut self) {
        let edges = self.app.state.edges;
        let volume = self.data.volume.as_ref().filter(|volume| volume.lacks(edges));
        if let Some(volume) = volume.filter(|_| !self.loader.is_doing(EDGING)) {
            self.loader.edge(Arc::clone(volume), edges);
        }
    }

    /// Begins to make, beside the window, the data with which the splats of a subject move faster.
    pub(super) fn prepare(&mut self, canvas: &Canvas, subject: Subject) -> Result<()> {
        let Some(splats) = canvas.splats_of(subject) else { return Ok(()) };
        // The colours of the error are ready, and others are not shown.
        if subject == Subject::Splats && self.error_shown || !self.prepared.insert(subject) {
            return Ok(());
        }
        let own = self.own_mode(subject);
        let levels = quality_levels(self.kind);
        let needs = |what| {
            let lacks = |mode| mode_row(mode).needs == what;
            let any = own.map_or_else(|| levels.iter().any(|level| lacks(level.mode)), lacks);
            any && !what.are_met(splats, self.app.state.decoding())
        };
        if needs(Needs::Faces) {
            let job = splats.preparation(canvas.gpu())?;
            self.loader.prepare("preparing what moves", |_| job());
        }
        if needs(Needs::DecodedField) {
            if mode_row(self.wanted_mode(subject)).needs == Needs::DecodedField {
                self.decode(canvas, subject)?;
            } else if !self.decoding.contains_key(&subject) {
                self.loader.prepare(
                    "decoding what moves",
                    splats.decoding(canvas.gpu(), self.app.state.decoding())?,
                );
            }
        }
        Ok(())
    }

    /// Returns the only mode in which a subject may be shown. The user may show the first splats in every mode.
    fn own_mode(&self, subject: Subject) -> Option<&'static str> {
        match subject {
            Subject::Splats => self.error_shown.then_some(DECODED),
            _ => self.data.own_mode_beside().filter(|_| subject == Subject::Beside),
        }
    }
}
