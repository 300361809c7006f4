//! What the program says of itself to shells and to man: completions and manual pages.

use crate::support::Folder;

/// The commands that users type.
const COMMANDS: [&str; 19] = [
    "batch",
    "blocks",
    "bake",
    "fit",
    "eval",
    "rasterize",
    "render",
    "view",
    "pack",
    "page",
    "compare",
    "stats",
    "info",
    "convert",
    "devices",
    "explain",
    "phantom",
    "completions",
    "man",
];

#[test]
fn completions_know_every_command_and_the_flags() {
    let folder = Folder::new(8);
    for (shell, start) in
        [("bash", "_vgs()"), ("zsh", "#compdef vgs"), ("fish", "complete"), ("powershell", "using namespace")]
    {
        let ended = folder.run(&["completions", shell]);
        assert_eq!((ended.code, ended.err.as_str()), (0, ""), "{shell}");
        assert!(ended.out.contains(start), "{shell}: {start}");
        for command in COMMANDS {
            assert!(ended.out.contains(command), "{shell}: {command}");
        }
        assert!(ended.out.contains("roi-threshold"), "{shell}");
    }
    let bash = folder.run(&["completions", "bash"]).out;
    for command in COMMANDS {
        assert!(bash.contains(&format!("vgs,{command})")), "bash completes vgs {command}");
    }
    let json = folder.run(&["completions", "bash", "--json"]).json();
    assert_eq!((json["shell"].as_str(), json["script"].as_str()), (Some("bash"), Some(bash.as_str())));
}

#[test]
fn the_short_help_fits_a_screen_and_the_long_one_has_everything() {
    let folder = Folder::new(8);
    let top = folder.run(&["-h"]).out;
    for command in COMMANDS {
        assert!(top.contains(&format!("  {command} ")), "{command} in {top}");
    }
    assert!(top.lines().count() <= 40, "{} lines: {top}", top.lines().count());
    assert!(folder.run(&["--help"]).out.contains("Exit codes"));
    for command in ["fit", "render", "eval"] {
        let short = folder.run(&[command, "-h"]).out;
        let lines = short.lines().count();
        assert!(lines <= 55, "{command}: {lines} lines: {short}");
        assert!(short.contains(&format!("`vgs {command} --help`")) && short.contains("Examples:"), "{short}");
    }
    assert!(!folder.run(&["fit", "-h"]).out.contains("--adam-epsilon"));
    assert!(folder.run(&["fit", "--help"]).out.contains("--adam-epsilon"));
}

#[test]
fn an_unknown_shell_is_refused_with_those_that_are_known() {
    let ended = Folder::new(8).run(&["completions", "cmd"]);
    assert_eq!((ended.code, ended.out.as_str()), (2, ""));
    for shell in ["bash", "zsh", "fish", "powershell"] {
        assert!(ended.err.contains(shell), "{}", ended.err);
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = Folder::new(8);
    let json = folder.run(&["man", "pages", "--json"]).json();
    let written = json["outputs"].as_array().expect("a list of files").len();
    assert_eq!(written, COMMANDS.len() + 1);
    let vgs = folder.text("pages/vgs.1");
    assert!(vgs.contains(".TH vgs 1") && vgs.contains("Exit codes"), "{vgs}");
    for command in COMMANDS {
        let page = folder.text(&format!("pages/vgs-{command}.1"));
        assert!(page.contains(".TH vgs") && page.contains("SYNOPSIS"), "{page}");
        assert!(vgs.contains(&format!("vgs\\-{command}(1)")), "vgs.1 names vgs-{command}(1)");
    }
    assert!(folder.text("pages/vgs-fit.1").contains("roi\\-threshold"));
}

#[test]
fn pages_that_exist_are_replaced_with_force_alone() {
    let folder = Folder::new(8);
    assert_eq!(folder.run(&["man", "pages"]).code, 0);
    folder.write("pages/vgs-fit.1", "mine");
    let before = folder.contents();
    let ended = folder.run(&["man", "pages"]);
    assert_eq!(ended.code, 73, "{}", ended.err);
    assert!(ended.err.contains("error[VGS-OUT-") && ended.err.contains("--force"), "{}", ended.err);
    assert!(folder.contents() == before, "nothing was touched");
    let ended = folder.run(&["man", "pages", "--force"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(folder.text("pages/vgs-fit.1").contains(".TH"));

    // A folder that cannot be made.
    let ended = folder.run(&["man", "none/pages"]);
    assert_eq!(ended.code, 73, "{}", ended.err);
    assert!(ended.err.contains("VGS-CLI-061"), "{}", ended.err);
    // A file in the place of the folder.
    let ended = folder.run(&["man", "ct.nii.gz"]);
    assert_eq!(ended.code, 73, "{}", ended.err);
    assert!(folder.contents().contains_key(&folder.path("ct.nii.gz")));
}
