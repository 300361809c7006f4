//! The short help (`-h`): what most people need, on one screen, by task. `--help` has everything.

use clap::{Arg, Command};

/// The commands, by what a user wants to do.
const TASKS: &[(&str, &[&str])] = &[
    ("From a scan to splats", &["info", "fit", "batch", "blocks", "convert", "bake"]),
    ("To look at", &["view", "render", "page", "pack"]),
    ("To measure", &["stats", "eval", "compare", "rasterize"]),
    ("To set up and to try", &["devices", "explain", "phantom", "completions", "man"]),
];

/// Help of a command with more flags than a screen has lines.
struct Short {
    command: &'static str,
    /// Flags that are told; the required ones always are.
    flags: &'static [&'static str],
    examples: &'static str,
}

const SHORT: &[Short] = &[
    Short {
        command: "fit",
        flags: &[
            "volume",
            "series",
            "roi",
            "roi_threshold",
            "roi_label",
            "roi_largest",
            "output",
            "force",
            "picture",
            "quality",
            "density",
            "time_budget",
            "explain",
            "resume",
        ],
        examples: "\
Examples:
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply
  vgs fit ct.nii.gz --roi labels.nii.gz --roi-label liver,aorta -o organs.ply --quality fine
  vgs fit scans/ --series 3 --roi-threshold 200,3000 --roi-largest --roi-fill -o bone.ply",
    },
    Short {
        command: "render",
        flags: &[
            "splats",
            "volume",
            "roi",
            "roi_threshold",
            "output",
            "force",
            "mode",
            "tf",
            "camera",
            "size",
            "clip",
            "object",
            "turntable",
        ],
        examples: "\
Examples:
  vgs render bones.ply -o bones.png
  vgs render ct.nii.gz --roi bones.nii.gz -o ct.png --camera left --tf CT-Bone
  vgs render bones.ply liver.ply -o both.png --object liver:colour=#cc4433,opacity=0.5",
    },
    Short {
        command: "eval",
        flags: &["splats", "volume", "roi", "roi_threshold", "roi_label", "range", "picture", "force"],
        examples: "\
Examples:
  vgs eval bones.ply ct.nii.gz --roi bones.nii.gz
  vgs eval bones.ply ct.nii.gz --roi bones.nii.gz --picture eval.png",
    },
];

/// The top of the help of the whole program; `TASKS` stands for the commands.
const TEMPLATE: &str = "\
{about-with-newline}
{usage-heading} {usage}

TASKSOptions:
{options}{after-help}";

const HINT: &str = "`vgs COMMAND -h` lists the usual flags of a command, `--help` all of them.";

/// Returns the command line with a short help beside the whole one.
pub fn shortened(vgs: Command) -> Command {
    let tasks: String = TASKS.iter().map(|(task, names)| section(&vgs, task, names)).collect();
    let whole = vgs.get_after_help().map(ToString::to_string).unwrap_or_default();
    let vgs = vgs
        .help_template(TEMPLATE.replace("TASKS", &tasks))
        .after_long_help(format!("{HINT}\n\n{whole}"))
        .after_help(HINT);
    SHORT.iter().fold(vgs, |vgs, short| vgs.mut_subcommand(short.command, |command| short.of(command)))
}

/// Returns the lines of the commands of a task.
fn section(vgs: &Command, task: &str, names: &[&str]) -> String {
    let line = |name: &&str| {
        let about = vgs.find_subcommand(name).and_then(Command::get_about);
        format!("  {name:<12} {}\n", about.map(ToString::to_string).unwrap_or_default())
    };
    format!("{task}:\n{}\n", names.iter().map(line).collect::<String>())
}

impl Short {
    fn of(&self, command: Command) -> Command {
        let whole = command.get_after_help().map(ToString::to_string).unwrap_or_default();
        let rest = format!("{}\n\n`vgs {} --help` has everything.", self.examples, self.command);
        let hide = |arg: Arg| {
            let told = self.flags.contains(&arg.get_id().as_str());
            arg.hide_short_help(!told)
        };
        command.mut_args(hide).after_long_help(whole).after_help(rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_of_the_table_exist() {
        let vgs = shortened(crate::command_line());
        for short in SHORT {
            let command = vgs.find_subcommand(short.command).expect(short.command);
            for flag in short.flags {
                assert!(command.get_arguments().any(|arg| arg.get_id() == flag), "{} {flag}", short.command);
            }
        }
    }

    #[test]
    fn every_command_has_a_task() {
        let vgs = crate::command_line();
        let told: Vec<_> = TASKS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        let mut names: Vec<_> = vgs.get_subcommands().map(|command| command.get_name()).collect();
        names.sort_unstable();
        let mut sorted = told.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, names);
    }
}
