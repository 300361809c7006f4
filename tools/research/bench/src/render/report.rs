//! Writes tables of the measurements in Markdown.

use super::config::Section;
use super::figures::{dash, db, mb, ms, thousands};
use super::goals::{self, GoalResult};
use super::plan::{Source, Unit};
use super::record::{Comparison, Record, Role, Timing};
use super::results::Results;
use super::table5;
use crate::cost::{Cost, mean, median, percentile};
use crate::report::Table;

/// Bytes of a splat, packed and in full.
const PACKED: usize = 16;

const FULL: usize = size_of::<engine::splat::Splat>();

/// Number of passes that are listed for a rendering.
const PASSES: usize = 6;

impl Results<'_> {
    /// Returns the report in Markdown.
    pub fn markdown(&self) -> String {
        let mut text = self.preamble();
        for &section in self.config.parts.keys().filter(|section| self.sections.contains(section)) {
            text += "\n";
            text += &match section {
                Section::EndToEnd => self.end_to_end(),
                Section::RendererError => self.renderer_error(),
                Section::Storage => self.storage(),
                Section::Speed => self.speed(),
                Section::Table5 => table5::markdown(self),
            };
            text += &self.left_out(section);
        }
        text
    }

    fn preamble(&self) -> String {
        let mut text = format!("# Rendering\n\nDevice: {}.\n", self.device.text);
        if self.device.is_cpu {
            text += "This is a software driver: times are of the CPU, good for ratios, and no GPU's. ";
            text += "core-ms are CPU time of the process, user and system, all threads.\n";
        }
        if self.quick {
            text += "\n**A quick run:** one subject a section, two views, half the size, short fits. \
                     Its figures are not those that goals speak of.\n";
        }
        text += &format!("\n```sh\n{}\n```\n", self.command);
        let orbit = self.config.orbit;
        text + &format!(
            "\nViews: {} around the region, evenly spaced in azimuth, {}° above and below it in turn, field of view \
             {}°, each filled by the region. PSNR is the mean over the views of 10 lg (1 / MSE) of red, green and blue, \
             premultiplied, over black; SSIM of luma, window 11; FLIP at 67 pixels a degree.\n",
            orbit.count, orbit.elevation, orbit.fov
        )
    }

    fn left_out(&self, section: Section) -> String {
        let mut lines: Vec<String> =
            self.plan.left_out.iter().filter(|line| line.starts_with(section.name())).cloned().collect();
        for unit in self.plan.units.iter().filter(|unit| unit.section == section) {
            let key = unit.key();
            let told = |line: &str| format!("{}, splats: {}: {line}", unit.case.name, unit.amount());
            match (self.records.get(&key), self.skipped.get(&key)) {
                (Some(record), _) => lines.extend(record.left_out.iter().map(|line| told(line))),
                (None, Some(why)) => lines.push(told(why)),
                (None, None) => lines.push(told("not measured yet")),
            }
        }
        let lines: String = lines.iter().map(|line| format!("- {line}\n")).collect();
        if lines.is_empty() { lines } else { format!("\nLeft out:\n{lines}") }
    }

    /// Returns the table rows of the pictures with these roles; the last columns differ.
    fn pictures(&self, section: Section, roles: &[Role]) -> Vec<Vec<String>> {
        let mut rows = Vec::new();
        for (unit, record) in self.units(section) {
            for row in record.comparisons.iter().filter(|row| roles.contains(&row.role)) {
                let is_reference = row.role == Role::Reference;
                let figure = |text: String| if is_reference { "reference".to_owned() } else { text };
                rows.push(vec![
                    subject(unit, record),
                    row.transfer.clone(),
                    row.rendering.clone(),
                    figure(db(row.psnr())),
                    figure(db(row.worst_psnr())),
                    figure(format!("{:.4}", row.ssim())),
                    figure(format!("{:.4}", row.flip())),
                    format!("{:.0}", row.cost(self.device.is_cpu)),
                    bytes(row, record.splats),
                    self.goal(unit, record, row),
                ]);
            }
        }
        rows
    }

    fn goal(&self, unit: &Unit, record: &Record, row: &Comparison) -> String {
        let of = |name: &str| {
            record
                .comparisons
                .iter()
                .find(|other| {
                    other.transfer == row.transfer && other.rendering == name && other.role == row.role
                })
                .map(Comparison::psnr)
        };
        let found = GoalResult {
            section: unit.section,
            case: &unit.case.name,
            splats: count(unit),
            transfer: &row.transfer,
            rendering: &row.rendering,
            psnr: (row.role != Role::Reference).then(|| row.psnr()),
            ssim: Some(row.ssim()),
            core_ms: None,
            faster: None,
        };
        goals::cell(&self.config.goals, &found, of)
    }

    fn columns(&self) -> Vec<&'static str> {
        let cost = if self.device.is_cpu { "core-ms a frame" } else { "device ms a frame" };
        vec![
            "case",
            "transfer function",
            "rendering",
            "PSNR, dB",
            "worst view, dB",
            "SSIM",
            "FLIP",
            cost,
            "MB",
            "goal",
        ]
    }

    fn end_to_end(&self) -> String {
        let size = self.size(Section::EndToEnd);
        let title = format!(
            "## End to end\n\nPictures of {size}×{size} pixels against the CT with its mask, ray-marched in the steps of \
             the rendering that is the reference. ÷2, ÷4: the CT and its mask, averaged over blocks of so many voxels along each \
             axis and rendered in the same way. MB of splats: of {PACKED} bytes (in brackets of {FULL}); of a volume: its box around the region, 16 bits of \
             intensity and 8 of mask a voxel."
        );
        let rows = self.pictures(Section::EndToEnd, &[Role::Reference, Role::Mode, Role::Downsampled]);
        Table { title, columns: self.columns(), rows }.markdown()
    }

    fn renderer_error(&self) -> String {
        let size = self.size(Section::RendererError);
        let title = format!(
            "## Error of the modes\n\nPictures of {size}×{size} pixels of the same splats, against mode `exact`. Numbers after a \
             name are the distance of the slabs in standard deviations of the middle splat; `point` classifies at the samples, \
             `integrated` between them. The cost is the median over the views, after a first frame."
        );
        let modes = self.pictures(Section::RendererError, &[Role::Reference, Role::Mode]);
        let mut text = Table { title, columns: self.columns(), rows: modes }.markdown();
        text += "\n![PSNR against cost](accuracy-cost.svg)\n\n\
                 ![PSNR against the distance of slabs](slab-distance.svg)\n\n";
        let title =
            "### One order for two eyes\n\nEyes 64 mm apart, rendered together, against each rendered alone."
                .to_owned();
        let eyes = self.pictures(Section::RendererError, &[Role::TwoEyes]);
        text + &Table { title, columns: self.columns(), rows: eyes }.markdown()
    }

    fn storage(&self) -> String {
        let size = self.size(Section::Storage);
        let title = format!(
            "## Storage\n\nPictures of {size}×{size} pixels of splats that were packed into {PACKED} bytes, against the same \
             splats in full ({FULL} bytes), in the same mode."
        );
        Table { title, columns: self.columns(), rows: self.pictures(Section::Storage, &[Role::Packed]) }
            .markdown()
    }

    fn size(&self, section: Section) -> u32 {
        self.config.parts.get(&section).map_or(0, |part| part.size)
    }

    fn speed(&self) -> String {
        let size = self.size(Section::Speed);
        let (mut frames, mut passes, mut memory) = (Vec::new(), Vec::new(), Vec::new());
        for (unit, record) in self.units(Section::Speed) {
            for row in &record.timings {
                let start = [subject(unit, record), row.transfer.clone(), row.rendering.clone()];
                frames.push([start.to_vec(), self.frame_cells(unit, record, row)].concat());
                let told: Vec<String> = row
                    .passes
                    .a_frame(row.frames.len())
                    .iter()
                    .take(PASSES)
                    .map(|(n, ms)| format!("{n} {ms:.1}"))
                    .collect();
                passes.push([start.to_vec(), vec![told.join(", ")]].concat());
            }
            // Memory does not depend on the transfer function except for its tables.
            let last = record.timings.last().map(|row| &row.transfer);
            for row in record.timings.iter().filter(|row| Some(&row.transfer) == last) {
                let mut purposes: Vec<_> = row.memory.iter().collect();
                purposes.sort_by_key(|(_, bytes)| std::cmp::Reverse(**bytes));
                let told: Vec<String> =
                    purposes.iter().map(|(purpose, bytes)| format!("{purpose} {}", mb(**bytes))).collect();
                let all = row.memory.values().sum();
                memory.push(vec![subject(unit, record), row.rendering.clone(), mb(all), told.join(", ")]);
            }
        }
        let title = format!(
            "## Speed\n\nFrames of {size}×{size} pixels, in rounds of one frame of each rendering from the same camera. \
             \"Picture\" is the PSNR of the first one against the most accurate rendering of the same; it was taken before any \
             frame was timed. \"Volume costs\": {} of the volume with its mask over those of this row, the median of the rounds. \"Change\": \
             what another transfer function costs once, beside its frame.",
            self.device.unit()
        );
        let change = if self.device.is_cpu { "change, core-ms" } else { "change, device ms" };
        let columns = vec![
            "case",
            "transfer function",
            "rendering",
            "picture, dB",
            "core-ms: median",
            "core-ms: mean",
            "wall, ms: median",
            "wall, ms: p95",
            "device, ms: median",
            change,
            "volume costs",
            "goal",
        ];
        let frames = Table { title, columns, rows: frames }.markdown();
        let title = "### Passes\n\nDevice time of the slowest passes, ms a frame.".to_owned();
        let columns = vec!["case", "transfer function", "rendering", "passes"];
        let passes = Table { title, columns, rows: passes }.markdown();
        let title = "### Device memory\n\nMB in use after the last frame, by purpose.".to_owned();
        let columns = vec!["case", "rendering", "all, MB", "by purpose, MB"];
        format!("{frames}\n{passes}\n{}", Table { title, columns, rows: memory }.markdown())
    }

    fn frame_cells(&self, unit: &Unit, record: &Record, row: &Timing) -> Vec<String> {
        let core: Option<Vec<f64>> = row.frames.iter().map(|(_, cost)| cost.core_ms).collect();
        let core_mean = core.as_deref().and_then(mean);
        let wall = row.each(|cost| cost.wall_ms);
        let faster = self.faster(record, row);
        let found = GoalResult {
            section: unit.section,
            case: &unit.case.name,
            splats: count(unit),
            transfer: &row.transfer,
            rendering: &row.rendering,
            psnr: row.psnr(),
            ssim: None,
            core_ms: core_mean.filter(|_| self.device.is_cpu),
            faster,
        };
        vec![
            row.psnr().map_or_else(dash, db),
            ms(core.as_deref().and_then(median)),
            ms(core_mean),
            ms(median(&wall)),
            ms(percentile(&wall, 0.95)),
            ms(median(&row.each(|cost| cost.device_ms))),
            ms(row.change(self.device.is_cpu)),
            faster.map_or_else(dash, |ratio| format!("{ratio:.2}×")),
            goals::cell(&self.config.goals, &found, |_| None),
        ]
    }

    /// Returns how many times more the volume with its mask costs in the same rounds.
    fn faster(&self, record: &Record, row: &Timing) -> Option<f64> {
        let is_volume =
            |other: &&Timing| other.mode == "volume" && !other.whole && other.transfer == row.transfer;
        let volume =
            record.timings.iter().find(is_volume).filter(|volume| volume.rendering != row.rendering)?;
        let cost = |cost: &Cost| cost.of_device(self.device.is_cpu);
        let pairs = volume.frames.iter().zip(&row.frames);
        median(&pairs.map(|((_, volume), (_, this))| cost(volume) / cost(this)).collect::<Vec<_>>())
    }
}

/// Describes the case, its source and its splats.
fn subject(unit: &Unit, record: &Record) -> String {
    let fitted = match (&unit.source, unit.case.profile.as_str()) {
        (Source::File(..), _) | (_, "default") => String::new(),
        (Source::Fit(_), profile) => format!(", --profile {profile}"),
    };
    format!("{} ({}), {} splats{fitted}", unit.case.name, unit.case.source(), thousands(record.splats as u64))
}

/// Returns the number of splats that was asked for; `None` if it was a density or a file.
fn count(unit: &Unit) -> Option<usize> {
    match &unit.source {
        Source::Fit(config) if config.count.splats > 0 => Some(config.count.splats),
        _ => None,
    }
}

fn bytes(row: &Comparison, splats: usize) -> String {
    match (row.volume_bytes, row.packed_bytes) {
        (Some(bytes), _) | (None, Some(bytes)) => mb(bytes),
        (None, None) => format!("{} ({})", mb((splats * PACKED) as u64), mb((splats * FULL) as u64)),
    }
}
