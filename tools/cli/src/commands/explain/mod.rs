//! Says what the codes of errors and of the end of a program mean (`vgs explain`).
//!
//! The codes are in `codes.txt`, which a test writes from the sources.

use clap::Args;
use engine::{Error, Kind};
use serde::Serialize;

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::table;

/// Says what an error code or an exit code means
///
/// Every error has a code, which stays as it is while its text may change: `error[VGS-NII-012]` on stderr, "code" with
/// --json. The exit code of the program follows from the kind of the error.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct ExplainArguments {
    /// An error code (VGS-NII-012), a group of them (NII) or an exit code (65); without one all groups and exit codes
    #[arg(value_name = "CODE")]
    what: Option<String>,
}

const EXAMPLES: &str = "\
Examples:
  vgs explain VGS-NII-012
  vgs explain NII             all errors of NIfTI files
  vgs explain 65              all errors with which a program ends so
  vgs explain";

const CODES: &str = include_str!("codes.txt");

/// A message of an error; `…` and names in braces stand for what is put in.
#[derive(Clone, Copy, Serialize)]
struct Message {
    code: &'static str,
    /// Exit codes, with commas between them.
    exit: &'static str,
    message: &'static str,
}

impl Message {
    fn exits(&self) -> impl Iterator<Item = &'static str> {
        self.exit.split(',')
    }
}

/// Codes that begin with the same letters, such as `NII`.
struct Group {
    name: &'static str,
    about: &'static str,
    messages: Vec<Message>,
}

fn groups() -> Vec<Group> {
    let mut groups = Vec::<Group>::new();
    for line in CODES.lines().filter(|line| !line.starts_with('#')) {
        if let Some((name, about)) = line.strip_prefix('[').and_then(|line| line.split_once("] ")) {
            groups.push(Group { name, about, messages: Vec::new() });
        } else if let (Some(group), Some((code, rest))) = (groups.last_mut(), line.split_once(' ')) {
            let (exit, message) = rest.split_once(' ').unwrap_or((rest, ""));
            group.messages.push(Message { code, exit, message });
        }
    }
    groups
}

/// Returns the kinds of errors that end a program with one of these codes.
fn kinds(exits: &[&str]) -> Vec<Kind> {
    Kind::ALL.into_iter().filter(|kind| exits.contains(&kind.exit_code().to_string().as_str())).collect()
}

/// Returns exit codes with what they mean.
fn exit_table(kinds: &[Kind]) -> String {
    let row = |kind: &Kind| vec![kind.exit_code().to_string(), kind.meaning().to_owned()];
    table(&["exit", "meaning"], &kinds.iter().map(row).collect::<Vec<_>>())
}

fn message_table(messages: &[Message]) -> String {
    let row = |m: &Message| [m.code, m.exit, m.message].map(str::to_owned).to_vec();
    table(&["code", "exit", "message"], &messages.iter().map(row).collect::<Vec<_>>())
}

/// Returns the messages that are asked for: of a code, of a group or with an exit code.
fn found(groups: &[Group], what: &str) -> Vec<Message> {
    let name = what.trim_matches(['[', ']']).to_uppercase();
    let short = name.strip_prefix("VGS-").unwrap_or(&name);
    let asked = |group: &Group, m: &Message| {
        m.code.strip_prefix("VGS-") == Some(short)
            || group.name == short
            || m.exits().any(|exit| exit == what)
    };
    groups.iter().flat_map(|group| group.messages.iter().filter(|m| asked(group, m)).copied()).collect()
}

/// Runs the command.
pub fn run(arguments: &ExplainArguments, console: &Console) -> Result<u8, Stop> {
    let groups = groups();
    let Some(what) = &arguments.what else {
        if console.json {
            let all: Vec<Message> = groups.iter().flat_map(|group| group.messages.clone()).collect();
            console.json_data(&serde_json::json!({ "codes": all }))?;
            return Ok(0);
        }
        let row = |g: &Group| vec![g.name.to_owned(), g.about.to_owned(), g.messages.len().to_string()];
        console.data(&exit_table(&Kind::ALL))?;
        console
            .data("\n0 is success; 130 and 143 are a stop by a signal, with what was reached written.\n\n")?;
        console
            .data(&table(&["group", "errors of", "messages"], &groups.iter().map(row).collect::<Vec<_>>()))?;
        return Ok(0);
    };
    let messages = found(&groups, what);
    let exits: Vec<&str> = messages.iter().flat_map(Message::exits).collect();
    if messages.is_empty() {
        let names: Vec<&str> = groups.iter().map(|group| group.name).collect();
        return Err(Error::new(
            Kind::Usage,
            "VGS-CLI-071",
            format!("{what} is no code of an error, no group of codes and no exit code"),
        )
        .help(format!(
            "give a code as an error shows it, such as VGS-NII-012; the groups are {}",
            names.join(", ")
        ))
        .into());
    }
    if console.json {
        console.json_data(&serde_json::json!({ "codes": messages }))?;
        return Ok(0);
    }
    console.data(&message_table(&messages))?;
    console.data(&format!("\n{}", exit_table(&kinds(&exits))))?;
    console.say("… and names in braces stand for what is put in; what to do stands below the error itself, after `help`");
    Ok(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_groups_and_exit_codes_are_found() {
        let groups = groups();
        assert!(
            groups.len() > 20 && groups.iter().all(|group| !group.messages.is_empty()),
            "the file is read"
        );
        let codes = |what: &str| found(&groups, what).iter().map(|m| m.code).collect::<Vec<_>>();
        for same in ["VGS-CLI-020", "vgs-cli-020", "CLI-020", "[VGS-CLI-020]"] {
            assert_eq!(codes(same), ["VGS-CLI-020"], "{same}");
        }
        assert!(codes("nii").len() > 5 && codes("NII").iter().all(|code| code.starts_with("VGS-NII-")));
        assert!(codes("73").contains(&"VGS-CLI-021") && !codes("73").contains(&"VGS-CLI-020"));
        assert!(codes("VGS").is_empty() && codes("7").is_empty() && codes("").is_empty());
    }

    #[test]
    fn every_exit_code_has_a_meaning() {
        let all = groups();
        for message in all.iter().flat_map(|group| &group.messages) {
            let exits: Vec<&str> = message.exits().collect();
            assert_eq!(kinds(&exits).len(), exits.len(), "{}: {}", message.code, message.exit);
        }
    }
}
