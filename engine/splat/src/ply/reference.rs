//! The PLY of the paper's authors: one element `vertex`, whose numbers stand for other things than usual.
//!
//! | property | there | in an ordinary file |
//! |---|---|---|
//! | x, y, z | voxel index × spacing, mm: no origin, no rotation | place |
//! | scale_k | ln(s_k · extent_k), extent_k = (dim_k − 1) · spacing_k | ln σ |
//! | rot_0..3 | R in the cube [0, 1]³, where the volume is x = i / (dim − 1) and a splat R diag(s²) Rᵀ | R |
//! | opacity | α itself | its logit |
//! | intensity_01 | part of the region's intensity range | |
//! | hu | intensity_01 over the range of the whole file: no HU of the splat unless both ranges are one | |
//! | ao | ambient occlusion, already in f_dc; not read | |
//!
//! With D = diag(dim − 1) the shape in voxels is D R diag(s²) Rᵀ D. What this program writes in the layout
//! has the right `hu` and says so in its comments (`vgs.layout reference`), with the kernel and the field of
//! the fit; reading it gives the set back. Files without comments have the authors' field: V̂ = Σ α κ c / (Σ
//! α κ + 10⁻⁶) over intensities from 0 to 1, so that the background is the lower end of the region's range.

use std::io::Write;
use std::path::Path;

use glam::{DMat3, DVec3};
use ply_rs::ply::ElementDef;
use rayon::prelude::*;

use super::comments;
use super::encode::BLOCK_ROWS;
use super::header::{Header, bad};
use super::names::INTENSITY_ELEMENT;
use crate::harmonics::SH0;
use crate::space::{centre, reshaped};
use crate::{Activations, Field, Grid, Kernel, Place, Splat, SplatSet};
use base::error::{Error, Kind, Result};

/// Name of the layout.
pub(super) const NAME: &str = "reference";

/// The kernel of files that name none.
pub const KERNEL: Kernel = Kernel::Gated;

/// ε of the authors' field.
const EPSILON: f32 = 1e-6;

/// The property that no other layout has.
pub(super) const INTENSITY_01: &str = "intensity_01";

/// How far a probability may lie outside [0, 1], as sums of f32 do.
const OVERSHOOT: f32 = 1e-3;

/// Least span of `intensity_01` over which `hu` as a line of it can be determined.
const LEAST_SPAN: f32 = 0.05;

/// Two ranges count as the same if their ends differ by no more than this part of the span.
const SAME_RANGE: f64 = 0.01;

/// Vertex properties as they are written.
const PROPERTIES: [&str; 19] = [
    "x",
    "y",
    "z",
    "nx",
    "ny",
    "nz",
    "f_dc_0",
    "f_dc_1",
    "f_dc_2",
    INTENSITY_01,
    "hu",
    "opacity",
    "scale_0",
    "scale_1",
    "scale_2",
    "rot_0",
    "rot_1",
    "rot_2",
    "rot_3",
];

/// Returns true if a file is of this layout: its comments say so, or it has the property of the layout and
/// nothing that only our files have.
pub(super) fn is_layout(header: &Header, vertex: &ElementDef, stated: &comments::Stated) -> bool {
    let plain = !header.comments.iter().any(|comment| comment.trim_start().starts_with("vgs."));
    let alone = header.element(INTENSITY_ELEMENT).is_none();
    stated.reference || (plain && alone && vertex.properties.contains_key(INTENSITY_01))
}

/// Values of the rows of a file beside its splats. Until they are placed, means are voxel index times
/// spacing, and logits are probabilities.
#[derive(Clone, Debug)]
pub struct Rows {
    /// `intensity_01` of each splat.
    pub intensity_01: Vec<f32>,
    /// True if the intensities of the splats are the property `hu`; otherwise they mean nothing.
    pub has_hu: bool,
    /// True if this program wrote the file: then `hu` and the field are right as they are.
    pub ours: bool,
}

impl Rows {
    /// Returns the field as far as it can be inferred from the file itself.
    pub fn field(&self, splats: &[Splat]) -> Field {
        let low = self.line(splats).map_or(0.0, |[low, _]| low as f32);
        Field { kernel: KERNEL, background: low, epsilon: EPSILON, ..Field::default() }
    }

    /// Fails if an opacity is not a probability.
    pub fn check(&self, splats: &[Splat]) -> Result<()> {
        let allowed = -OVERSHOOT..=1.0 + OVERSHOOT;
        match splats.iter().position(|s| !allowed.contains(&s.opacity_logit)) {
            None => Ok(()),
            Some(index) => {
                let opacity = splats[index].opacity_logit;
                let message = format!(
                    "splat {index} has the opacity {opacity}; beside `{INTENSITY_01}` it must be a probability, 0 to 1"
                );
                Err(bad("VGS-PLY-027", message).help(
                    "the file mixes layouts: write opacities as probabilities, or leave out `intensity_01`",
                ))
            }
        }
    }

    /// Returns the values of `hu` at 0 and 1 of `intensity_01`; `None` if the file has no `hu` or
    /// `intensity_01` spans too little to tell.
    fn line(&self, splats: &[Splat]) -> Option<[f64; 2]> {
        let by_part = |a: &usize, b: &usize| self.intensity_01[*a].total_cmp(&self.intensity_01[*b]);
        let least = (0..splats.len()).filter(|_| self.has_hu).min_by(by_part)?;
        let most = (0..splats.len()).max_by(by_part)?;
        let [from, to] = [least, most].map(|i| f64::from(self.intensity_01[i]));
        let [low, high] = [least, most].map(|i| f64::from(splats[i].intensity));
        let slope = (high - low) / (to - from);
        (to - from >= f64::from(LEAST_SPAN)).then_some([low - slope * from, low + slope * (1.0 - from)])
    }

    /// Returns `set` with its splats placed in the world by `place`.
    pub(crate) fn placed(self, mut set: SplatSet, place: &Place, path: &Path) -> Result<SplatSet> {
        if !self.ours {
            self.take_intensities(&mut set, place, path)?;
        }
        let (spacing, steps) = (place.spacing_mm(), place.steps());
        let linear = place.world_from_voxel.matrix3 * DMat3::from_diagonal(steps);
        let ln_extent = (spacing * steps).to_array().map(f64::ln);
        let means: Vec<DVec3> = set
            .splats
            .iter()
            .map(|s| {
                place.world_from_voxel.transform_point3(DVec3::from_array(s.mean.map(f64::from)) / spacing)
            })
            .collect();
        set.grid = Some(Grid::of_voxels(place.size, place.world_from_voxel));
        set.splats.par_iter_mut().zip(&means).for_each(|(splat, mean)| {
            let probability = splat.opacity_logit;
            let log_scale = std::array::from_fn(|k| (f64::from(splat.log_scale[k]) - ln_extent[k]) as f32);
            *splat = reshaped(&Splat { log_scale, ..*splat }, &linear);
            splat.set_opacity(probability);
            splat.mean = mean.to_array().map(|v| v as f32);
        });
        if !set.is_exact() {
            set.origin_mm = centre(means.iter().copied());
            for (splat, mean) in set.splats.iter_mut().zip(&means) {
                splat.mean = (*mean - set.origin_mm).to_array().map(|v| v as f32);
            }
        }
        Ok(set)
    }

    /// Sets the intensities of the splats to what `intensity_01` stands for in the range of the region.
    /// Without a region they stay the file's `hu`; without these either, this fails.
    fn take_intensities(&self, set: &mut SplatSet, place: &Place, path: &Path) -> Result<()> {
        let file = path.display();
        if let Some([low, high]) = self.line(&set.splats) {
            let [least, most] = place.range.map(f64::from);
            let near = |a: f64, b: f64| (a - b).abs() <= SAME_RANGE * (most - least).max(high - low);
            if !(near(low, least) && near(high, most)) {
                tracing::warn!(
                    "{file}: its hu are over {low:.0} to {high:.0}, the volume has {least} to {most}: is it the volume \
                     that they were fitted to?"
                );
            }
        }
        match place.region_range {
            Some([low, high]) => {
                let span = f64::from(high) - f64::from(low);
                for (splat, &part) in set.splats.iter_mut().zip(&self.intensity_01) {
                    splat.intensity = (f64::from(low) + f64::from(part) * span) as f32;
                }
                set.field.background = low;
            }
            None if self.has_hu => {
                tracing::warn!(
                    "{file}: intensities are its hu, because no region is given: these are over the range of the whole \
                     file, and wrong where that is not the region's; give the mask of the fit with --roi"
                );
                let least = set.splats.iter().map(|s| s.intensity).fold(f32::INFINITY, f32::min);
                set.field.background =
                    self.line(&set.splats).map_or(least.min(place.range[0]), |[low, _]| low as f32);
            }
            None => {
                let message = format!(
                    "intensities are parts of a region's range (`{INTENSITY_01}`) and there is no `hu`"
                );
                return Err(Error::new(Kind::Usage, "VGS-PLY-028", message)
                    .help("give the mask of the fit, --roi, with the volume"));
            }
        }
        Ok(())
    }
}

/// Returns the place that the layout is written for, with the intensity range of its region. Without either
/// this is an internal error.
fn place_of(place: Option<&Place>) -> Result<(&Place, [f32; 2])> {
    let both = place.and_then(|place| Some((place, place.region_range?)));
    both.ok_or_else(|| {
        let message = "the layout of the paper's authors cannot be written without a volume and its region";
        Error::new(Kind::Internal, "VGS-PLY-029", message)
    })
}

/// Fails if `set` cannot be written in this layout.
pub(super) fn check(set: &SplatSet, place: Option<&Place>) -> Result<()> {
    let (place, _) = place_of(place)?;
    if !set.unit.is_physical() {
        let message = "splats without an intensity cannot be written in the layout of the paper's authors";
        return Err(Error::new(Kind::Usage, "VGS-PLY-030", message).help("write them with --ply-layout vgs"));
    }
    let linear = place.world_from_voxel.matrix3;
    if place.size.contains(&0) || !linear.is_finite() || linear.determinant() == 0.0 {
        return Err(Error::new(Kind::Internal, "VGS-PLY-029", "the volume has no voxels or no inverse"));
    }
    Ok(())
}

/// Returns what of `set` a file in this layout does not keep.
pub(super) fn losses(set: &SplatSet, place: Option<&Place>) -> Vec<String> {
    let mut losses = Vec::new();
    if set.labels.is_some() {
        losses.push("the labels of the splats, which it has no place for".to_owned());
    }
    if set.region.is_some() {
        losses.push("the region; what it shows ends softly, where its splats do".to_owned());
    }
    if let Some([low, high]) = place.and_then(|place| place.region_range) {
        let outside = set.splats.iter().filter(|s| !(low..=high).contains(&s.intensity)).count();
        if outside > 0 {
            losses.push(format!(
                "{outside} intensities beyond the region's {low} to {high} in `{INTENSITY_01}`, which ends there (`hu` \
                 has them)"
            ));
        }
    }
    losses
}

/// Writes `set`, which has been checked.
pub(super) fn encode(set: &SplatSet, place: Option<&Place>, out: &mut dyn Write) -> std::io::Result<()> {
    let (place, [low, high]) = place_of(place).map_err(std::io::Error::other)?;
    let properties: String = PROPERTIES.iter().map(|name| format!("property float {name}\n")).collect();
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}{}end_header\n",
        set.splats.len(),
        comments::of_reference(set, [low, high])
    )?;
    let (spacing, steps) = (place.spacing_mm(), place.steps());
    let voxel_from_world = place.world_from_voxel.matrix3.inverse();
    let origin = voxel_from_world * (set.origin_mm - place.world_from_voxel.translation);
    let linear = DMat3::from_diagonal(steps.recip()) * voxel_from_world;
    let ln_extent = (spacing * steps).to_array().map(f64::ln);
    let span = f64::from(high) - f64::from(low);
    for block in set.splats.chunks(BLOCK_ROWS) {
        let rows: Vec<[f32; PROPERTIES.len()]> = block
            .par_iter()
            .map(|splat| {
                let voxel = voxel_from_world * DVec3::from_array(splat.mean.map(f64::from)) + origin;
                let [x, y, z] = (voxel * spacing).to_array().map(|v| v as f32);
                let cube = reshaped(splat, &linear);
                let [s0, s1, s2] =
                    std::array::from_fn(|k| (f64::from(cube.log_scale[k]) + ln_extent[k]) as f32);
                let [r0, r1, r2, r3] = cube.rotation;
                let part =
                    if span > 0.0 { (f64::from(splat.intensity) - f64::from(low)) / span } else { 0.0 };
                let part = part.clamp(0.0, 1.0) as f32;
                let grey = (part - 0.5) / SH0;
                [
                    x,
                    y,
                    z,
                    0.0,
                    0.0,
                    0.0,
                    grey,
                    grey,
                    grey,
                    part,
                    splat.intensity,
                    splat.opacity(),
                    s0,
                    s1,
                    s2,
                    r0,
                    r1,
                    r2,
                    r3,
                ]
            })
            .collect();
        let bytes: Vec<u8> = rows.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        out.write_all(&bytes)?;
    }
    Ok(())
}
