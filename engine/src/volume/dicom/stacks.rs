//! Stacks: frames that lie parallel to each other, of which a volume can be made.

use std::collections::BTreeMap;

use super::header::Frame;
use crate::{Error, Kind, Result};

/// Cosine above which two directions count as the same: 0.26 degrees.
const SAME_DIRECTION: f64 = 0.99999;
/// Part by which pixel distances may differ and still count as the same.
const SAME_SPACING: f64 = 1e-4;
/// Distance above which two frames count as lying at different places, mm.
pub(super) const SAME_PLACE_MM: f64 = 1e-3;
/// Most rows of a list in a message; further ones are only counted.
const LISTED: usize = 20;

/// Frames of one series with one size and orientation, in the order of their places.
#[derive(Clone, Debug)]
pub(super) struct Stack {
    pub frames: Vec<Frame>,
    /// Attribute that distinguishes the stack from others of its series, such as "echo 2"; empty if there is
    /// no other.
    pub phase: String,
}

/// A stack in the list of a folder's content.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StackSummary {
    /// Number in the list, from 1: what `--series` takes.
    pub number: usize,
    /// UID of its series.
    pub series_uid: String,
    /// Kind of scanner, such as CT or MR.
    pub modality: String,
    /// Description by the operator of the scanner, and what distinguishes the stack from others of its
    /// series.
    pub description: String,
    /// Columns, rows and slices.
    pub size: [usize; 3],
    /// True if these are scout views.
    pub localizer: bool,
}

impl StackSummary {
    /// Returns the line of this stack in a list.
    pub fn line(&self) -> String {
        let [columns, rows, slices] = self.size;
        let kind = if self.localizer { ", localizer" } else { "" };
        let plural = if slices == 1 { "slice" } else { "slices" };
        let description = if self.description.is_empty() { "no description" } else { &self.description };
        format!(
            "{}: {} {description}, {slices} {plural} of {columns} x {rows}{kind}",
            self.number, self.modality
        )
    }
}

impl Stack {
    /// Returns the first frame; a stack has at least one.
    pub fn first(&self) -> &Frame {
        &self.frames[0]
    }

    pub fn summary(&self, number: usize) -> StackSummary {
        let Frame { file, size: [columns, rows], .. } = self.first();
        let description = [file.description.as_str(), self.phase.as_str()];
        let description: Vec<_> = description.into_iter().filter(|part| !part.is_empty()).collect();
        StackSummary {
            number,
            series_uid: file.series.clone(),
            modality: file.modality.clone(),
            description: description.join(", "),
            size: [*columns, *rows, self.frames.len()],
            localizer: file.localizer,
        }
    }

    /// Returns true if this may be a volume: scout views and single slices are not.
    fn is_volume(&self) -> bool {
        !self.first().file.localizer && self.frames.len() > 1
    }
}

/// Groups frames that lie parallel to each other into stacks: by series, then by size, orientation and kind.
/// If several frames lie at one place (phases, echoes), each phase is a stack of its own.
pub(super) fn stacks(frames: Vec<Frame>) -> Vec<Stack> {
    let mut series: BTreeMap<(i64, String), Vec<Vec<Frame>>> = BTreeMap::new();
    for frame in frames {
        let groups = series.entry((frame.file.series_number, frame.file.series.clone())).or_default();
        match groups.iter_mut().find(|group| are_parallel(&group[0], &frame)) {
            Some(group) => group.push(frame),
            None => groups.push(vec![frame]),
        }
    }
    let mut stacks = Vec::new();
    for mut groups in series.into_values() {
        groups.sort_by_key(|group| std::cmp::Reverse(group.len()));
        stacks.extend(groups.into_iter().flat_map(by_phase));
    }
    stacks
}

/// Returns true if two frames have the same size, orientation, pixel distances and kind.
pub(super) fn are_parallel(a: &Frame, b: &Frame) -> bool {
    a.size == b.size
        && a.file.localizer == b.file.localizer
        && (0..2).all(|i| {
            a.along[i].dot(b.along[i]) > SAME_DIRECTION
                && (a.spacing[i] - b.spacing[i]).abs() <= SAME_SPACING * a.spacing[i]
        })
}

/// Returns the position of a frame along the normal of its slices, mm.
pub(super) fn along_normal(frame: &Frame, normal: glam::DVec3) -> f64 {
    frame.position.dot(normal)
}

pub(super) fn normal(frame: &Frame) -> glam::DVec3 {
    frame.along[0].cross(frame.along[1]).normalize()
}

/// Sorts parallel frames by their places, drops copies of the same frame, and separates them into stacks if
/// several lie at one place and an attribute distinguishes them.
fn by_phase(mut frames: Vec<Frame>) -> Vec<Stack> {
    let normal = normal(&frames[0]);
    frames.sort_by(|a, b| {
        let by_place = along_normal(a, normal).total_cmp(&along_normal(b, normal));
        by_place.then_with(|| a.file.location.path.cmp(&b.file.location.path)).then(a.number.cmp(&b.number))
    });
    let before = frames.len();
    let mut known = std::collections::BTreeSet::new();
    frames.retain(|f| f.file.instance.is_empty() || known.insert((f.file.instance.clone(), f.number)));
    if frames.len() < before {
        let count = before - frames.len();
        tracing::warn!("{count} files are copies of others (the same SOP instance): left out");
    }
    if doubled(&frames).is_none() {
        return vec![Stack { frames, phase: String::new() }];
    }
    let names: Vec<&'static str> = frames[0].file.phases.iter().map(|(name, _)| *name).collect();
    for (i, name) in names.into_iter().enumerate() {
        let mut groups: BTreeMap<String, Vec<Frame>> = BTreeMap::new();
        for frame in &frames {
            let value = frame.file.phases.get(i).map(|(_, value)| value.clone()).unwrap_or_default();
            groups.entry(value).or_default().push(frame.clone());
        }
        if groups.len() > 1 && groups.values().all(|group| doubled(group).is_none()) {
            let stack = |(value, frames)| Stack { frames, phase: format!("{name} {value}") };
            return groups.into_iter().map(stack).collect();
        }
    }
    vec![Stack { frames, phase: String::new() }]
}

/// Returns two frames that lie at one place, if there are any; `frames` are in the order of their places.
pub(super) fn doubled(frames: &[Frame]) -> Option<[&Frame; 2]> {
    let normal = normal(&frames[0]);
    let pairs = frames.iter().zip(frames.iter().skip(1));
    let mut same = pairs.filter(|(a, b)| along_normal(b, normal) - along_normal(a, normal) < SAME_PLACE_MM);
    same.next().map(|(a, b)| [a, b])
}

/// Returns the stack that `asked` names: by its number in the list, the UID of its series, or a part of its
/// description. If `asked` is `None`, returns the only stack that may be a volume.
///
/// # Errors
/// [`Kind::Usage`] if no stack or several fit.
pub(super) fn choose<'a>(stacks: &'a [Stack], asked: Option<&str>) -> Result<&'a Stack> {
    let list = || stacks.iter().enumerate().map(|(i, stack)| stack.summary(i + 1));
    let usage = |message: String| {
        let mut rows: Vec<_> = list().take(LISTED).map(|row| row.line()).collect();
        if stacks.len() > LISTED {
            rows.push(format!("and {} more", stacks.len() - LISTED));
        }
        let help = format!("choose one with --series N; there is\n  {}", rows.join("\n  "));
        Error::new(Kind::Usage, "VGS-DCM-006", message).help(help)
    };
    let found: Vec<&Stack> = match asked {
        None => stacks.iter().filter(|stack| stack.is_volume()).collect(),
        Some(asked) => {
            let matches = |(i, stack): &(usize, &Stack)| {
                let row = stack.summary(i + 1);
                row.number.to_string() == asked || row.series_uid == asked
            };
            let exact: Vec<_> = stacks.iter().enumerate().filter(matches).map(|(_, stack)| stack).collect();
            let part = asked.to_lowercase();
            let described = |(i, stack): &(usize, &Stack)| {
                stack.summary(i + 1).description.to_lowercase().contains(&part)
            };
            match exact.is_empty() && !part.is_empty() && part.parse::<usize>().is_err() {
                true => stacks.iter().enumerate().filter(described).map(|(_, stack)| stack).collect(),
                false => exact,
            }
        }
    };
    match (found.as_slice(), stacks, asked) {
        ([one], ..) => Ok(one),
        // A single slice is also a volume if there is nothing else.
        ([], [one], None) if !one.first().file.localizer => Ok(one),
        ([], _, None) => {
            let scouts = stacks.iter().filter(|stack| stack.first().file.localizer).count();
            Err(usage(match scouts == stacks.len() {
                true => "there are only localizers (scout views), which are no volume".to_owned(),
                false => {
                    format!("no two slices are parallel: there are {} in as many orientations", stacks.len())
                }
            }))
        }
        ([], _, Some(asked)) => Err(usage(format!("there is no series '{asked}'"))),
        (several, _, None) => Err(usage(format!("there are {} series that may be meant", several.len()))),
        (several, _, Some(asked)) => Err(usage(format!("'{asked}' may mean {} series", several.len()))),
    }
}
