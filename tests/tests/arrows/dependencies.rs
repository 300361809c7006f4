//! Every dependency that a manifest names is used.

use std::collections::BTreeSet;

use super::{MEMBERS, code, root, sources};

/// Returns the names of the dependencies in the sections of a manifest whose names end so.
fn named(manifest: &str, section: &str) -> BTreeSet<String> {
    let mut inside = false;
    let mut names = BTreeSet::new();
    for line in manifest.lines().map(str::trim) {
        if let Some(title) = line.strip_prefix('[') {
            let title = title.trim_end_matches(']');
            inside = title == section || title.ends_with(&format!(".{section}"));
        } else if inside && !line.is_empty() && !line.starts_with('#') {
            names.extend(line.split(['.', ' ', '=']).next().map(str::to_owned));
        }
    }
    names
}

/// Returns true if code names a crate: `name::`, or `use name` and no more.
fn uses(code: &str, dependency: &str) -> bool {
    let name = dependency.replace('-', "_");
    code.match_indices(&name).any(|(at, _)| {
        let (before, after) = (&code[..at], &code[at + name.len()..]);
        let begins = !before.ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':');
        let whole = before.ends_with("use ") && after.starts_with([';', ' ']);
        begins && (after.starts_with("::") || whole)
    })
}

#[test]
fn every_dependency_is_used() {
    let mut unused = Vec::new();
    let mut wanted = BTreeSet::new();
    for (folder, _) in MEMBERS {
        let manifest = std::fs::read_to_string(root().join(folder).join("Cargo.toml")).expect("a manifest");
        let inner = |file: &str| {
            MEMBERS
                .iter()
                .any(|(other, _)| other.len() > folder.len() && file.starts_with(&format!("{other}/")))
        };
        let files: Vec<_> = sources(folder, "rs").into_iter().filter(|(file, _)| !inner(file)).collect();
        for section in ["dependencies", "dev-dependencies", "build-dependencies"] {
            let building = section == "build-dependencies";
            let code: String = files
                .iter()
                .filter(|(path, _)| path.ends_with("/build.rs") == building)
                .map(|(_, text)| code(text) + "\n")
                .collect();
            let names = named(&manifest, section);
            unused.extend(
                names.iter().filter(|name| !uses(&code, name)).map(|name| format!("{folder}: {name}")),
            );
            wanted.extend(names);
        }
    }
    assert!(
        unused.is_empty(),
        "these dependencies are named in a Cargo.toml and used by no source: {unused:?}"
    );
    let workspace =
        std::fs::read_to_string(root().join("Cargo.toml")).expect("the manifest of the workspace");
    let members: BTreeSet<_> = MEMBERS.map(|(_, name)| name.to_owned()).into();
    let offered = named(&workspace, "workspace.dependencies");
    let idle: Vec<_> =
        offered.iter().filter(|name| !wanted.contains(*name) && !members.contains(*name)).collect();
    assert!(
        offered.len() > 30 && idle.is_empty(),
        "no member wants these dependencies of the workspace: {idle:?}"
    );
}

#[test]
fn unused_dependencies_are_found() {
    let manifest = "[dependencies]\n# a comment\nply-rs.workspace = true\nglam = { version = \"1\" }\n\n\
                    [target.'cfg(unix)'.dependencies]\nrustix = \"1\"\n[dev-dependencies]\ntempfile = \"3\"\n";
    let names = |section| named(manifest, section).into_iter().collect::<Vec<_>>();
    assert_eq!(names("dependencies"), ["glam", "ply-rs", "rustix"]);
    assert_eq!(names("dev-dependencies"), ["tempfile"]);
    for (text, used) in [
        ("use ply_rs::ply::ElementDef;", true),
        ("let x = ply_rs::read();", true),
        ("use ply_rs as ply;", true),
        ("use super::ply_rs::x;", false),
        ("my_ply_rs::x", false),
        ("let ply_rs = 3;", false),
    ] {
        assert_eq!(uses(text, "ply-rs"), used, "{text}");
    }
}
