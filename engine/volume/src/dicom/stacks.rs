//! Stacks: frames that lie parallel to each other, of which a volume can be made.

use std::collections::BTreeMap;

use super::header::{Frame, PHASES, TIMES};
use base::{Error, Kind, Result};

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
    /// Notes for the user on frames that were left out.
    pub notes: Vec<String>,
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
    // Anonymisers give one UID to all files: a copy lies at the same place, and says the same.
    let mut kept: Vec<Frame> = Vec::with_capacity(before);
    let is_copy = |a: &Frame, b: &Frame| {
        !a.file.instance.is_empty()
            && (&a.file.instance, a.number) == (&b.file.instance, b.number)
            && (a.file.instance_number, a.file.times) == (b.file.instance_number, b.file.times)
            && a.phases == b.phases
    };
    for frame in frames {
        let at = along_normal(&frame, normal) - SAME_PLACE_MM;
        let here = kept.iter().rev().take_while(|other| along_normal(other, normal) > at);
        if !here.into_iter().any(|other| is_copy(other, &frame)) {
            kept.push(frame);
        }
    }
    let copies = before - kept.len();
    let mut stacks = separate(kept, String::new());
    if let (true, [stack, ..]) = (copies > 0, stacks.as_mut_slice()) {
        stack.notes.push(format!("copies of slices (the same SOP instance) are left out: {copies}"));
    }
    stacks
}

/// Separates frames, in the order of their places, into stacks without two frames at one place, as far as attributes
/// distinguish them. `phase` is what distinguishes all of them from others.
fn separate(frames: Vec<Frame>, phase: String) -> Vec<Stack> {
    let most = most_at_one_place(&frames);
    if most < 2 {
        return vec![Stack { frames, phase, notes: Vec::new() }];
    }
    let splits: Vec<Vec<(String, Vec<Frame>)>> = (0..PHASES.len()).map(|i| by_value(&frames, i)).collect();
    // One that leaves no two frames at one place is best, and else one that separates some.
    let is_exact = |groups: &[(String, Vec<Frame>)]| {
        let enough = groups.len() == most
            || groups.len() <= 2 * most && groups.iter().all(|(_, group)| group.len() > 1);
        enough && groups.iter().all(|(_, group)| most_at_one_place(group) == 1)
    };
    let is_partial = |groups: &[(String, Vec<Frame>)]| {
        groups.len() <= most && groups.iter().all(|(_, group)| most_at_one_place(group) < most)
    };
    let several = || splits.iter().filter(|groups| groups.len() > 1);
    let split =
        several().find(|groups| is_exact(groups)).or_else(|| several().find(|groups| is_partial(groups)));
    let split = split.cloned().or_else(|| in_order(&frames, most));
    if let Some(groups) = split {
        let join = |own: &str| if phase.is_empty() { own.to_owned() } else { format!("{phase}, {own}") };
        return groups.into_iter().flat_map(|(own, group)| separate(group, join(&own))).collect();
    }
    once_each(frames, phase)
}

/// Groups frames by the value of a row of [`PHASES`], in the order of their numbers.
fn by_value(frames: &[Frame], row: usize) -> Vec<(String, Vec<Frame>)> {
    let mut groups: BTreeMap<&str, Vec<Frame>> = BTreeMap::new();
    for frame in frames {
        groups.entry(&frame.phases[row]).or_default().push(frame.clone());
    }
    let mut groups: Vec<_> =
        groups.into_iter().map(|(value, frames)| (format!("{} {value}", PHASES[row].0), frames)).collect();
    let number = |frames: &[Frame]| frames[0].phases[row].parse::<f64>().unwrap_or(f64::INFINITY);
    groups.sort_by(|(_, a), (_, b)| number(a).total_cmp(&number(b)));
    groups
}

/// Groups frames by their order in time at their place, if there are `most` at each place and a row of [`TIMES`]
/// has different values for all of these: times are those of a phase and differ from slice to slice.
fn in_order(frames: &[Frame], most: usize) -> Option<Vec<(String, Vec<Frame>)>> {
    let places = places(frames);
    if places.iter().any(|place| place.len() != most) {
        return None;
    }
    (0..TIMES.len()).find_map(|row| {
        let mut groups: Vec<Vec<Frame>> = vec![Vec::new(); most];
        for place in &places {
            let mut timed: Vec<(f64, &Frame)> =
                place.iter().map(|frame| Some((frame.file.times[row]?, frame))).collect::<Option<_>>()?;
            timed.sort_by(|a, b| a.0.total_cmp(&b.0));
            if timed.windows(2).any(|pair| pair[0].0 == pair[1].0) {
                return None;
            }
            for (group, (_, frame)) in groups.iter_mut().zip(timed) {
                group.push(frame.clone());
            }
        }
        let name = |i: usize| format!("{} {} of {most}", TIMES[row].0, i + 1);
        Some(groups.into_iter().enumerate().map(|(i, group)| (name(i), group)).collect())
    })
}

/// Returns one stack: of the frames at one place the last one, if that is the exception. A slice is scanned again
/// where the patient has moved.
fn once_each(frames: Vec<Frame>, phase: String) -> Vec<Stack> {
    let places = places(&frames);
    let doubled = places.iter().filter(|place| place.len() > 1).count();
    let mut notes = Vec::new();
    if 2 * doubled >= places.len() {
        // Told where the planes are looked for.
        return vec![Stack { frames, phase, notes }];
    }
    let mut kept = Vec::with_capacity(places.len());
    for place in places {
        let order = |frame: &&Frame| {
            let [_, acquired, made] = frame.file.times;
            [acquired, made, frame.file.instance_number.map(|n| n as f64)].map(|v| v.unwrap_or(0.0))
        };
        let later = |a: &&Frame, b: &&Frame| {
            let pairs = order(a).into_iter().zip(order(b));
            pairs
                .map(|(a, b)| a.total_cmp(&b))
                .find(|order| order.is_ne())
                .unwrap_or(std::cmp::Ordering::Equal)
        };
        let Some(last) = place.iter().max_by(|a, b| later(a, b)) else { continue };
        if place.len() > 1 {
            let others = place.iter().filter(|frame| !std::ptr::eq(*frame, last)).map(name);
            notes.push(format!(
                "{} slices lie at one place: {} is taken, the last one, and {} is left out",
                place.len(),
                name(last),
                others.collect::<Vec<_>>().join(", ")
            ));
        }
        kept.push(last.clone());
    }
    vec![Stack { frames: kept, phase, notes }]
}

/// Returns the name of the file of a frame, and its number if it is not the first one.
pub(super) fn name(frame: &Frame) -> String {
    let name = frame.file.location.path.file_name().unwrap_or_default().to_string_lossy();
    if frame.number > 0 { format!("{name} (frame {})", frame.number + 1) } else { name.into_owned() }
}

/// Returns the frames at each place; `frames` are in the order of their places.
fn places(frames: &[Frame]) -> Vec<&[Frame]> {
    let normal = normal(&frames[0]);
    frames.chunk_by(|a, b| along_normal(b, normal) - along_normal(a, normal) < SAME_PLACE_MM).collect()
}

fn most_at_one_place(frames: &[Frame]) -> usize {
    places(frames).into_iter().map(<[Frame]>::len).max().unwrap_or(0)
}

/// Returns two frames that lie at one place, if there are any; `frames` are in the order of their places.
pub(super) fn doubled(frames: &[Frame]) -> Option<[&Frame; 2]> {
    places(frames).into_iter().find_map(|place| match place {
        [a, b, ..] => Some([a, b]),
        _ => None,
    })
}

/// Returns what names the stack at a place in the list wherever its files lie: the UID of its series, with its number
/// in the series where that has several (`1.2.3#2`); its number in the list without a UID.
pub(super) fn key(stacks: &[Stack], at: usize) -> String {
    let uid = |stack: &Stack| stack.first().file.series.clone();
    let own = uid(&stacks[at]);
    let count = |stacks: &[Stack]| stacks.iter().filter(|stack| uid(stack) == own).count();
    match count(stacks) {
        _ if own.is_empty() => (at + 1).to_string(),
        1 => own,
        _ => format!("{own}#{}", count(&stacks[..=at])),
    }
}

/// Returns the stack that `asked` names: by its number in the list, the UID of its series, its [`key`], or a part of
/// its description. If `asked` is `None`, returns the only stack that may be a volume.
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
                row.number.to_string() == asked || row.series_uid == asked || key(stacks, *i) == asked
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
                    format!("there are {} single slices, and no two of them make a volume", stacks.len())
                }
            }))
        }
        ([], _, Some(asked)) => Err(usage(format!("there is no series '{asked}'"))),
        (several, _, None) => Err(usage(format!("there are {} series that may be meant", several.len()))),
        (several, _, Some(asked)) => Err(usage(format!("'{asked}' may mean {} series", several.len()))),
    }
}
