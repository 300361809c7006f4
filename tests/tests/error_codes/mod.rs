//! codes.txt of `vgs explain` is what the sources say: every code with its exit code and its meaning.
//! `VGS_WRITE_ERROR_CODES=1` writes the file anew.
//!
//! The sources are read as tokens, not compiled; `sites` says which ways of making an error it understands, and a test holds
//! the sources to them.

mod meanings;
mod sites;
mod tokens;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use engine::Kind;
use meanings::{GROUPS, MEANINGS};
use sites::{Site, Sources, sites};

const HEAD: &str = "\
# Every error code of the programs: code, exit codes, message; `…` and names in braces stand for what is put in.
# A test writes this file from the sources: VGS_WRITE_ERROR_CODES=1 cargo test -p vgs-tests --test house error_codes
";

/// All that is known of a code.
#[derive(Clone, Debug, Default, PartialEq)]
struct CodeRow {
    kinds: BTreeSet<String>,
    messages: BTreeSet<String>,
}

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tools/cli/src/commands/explain/codes.txt")
}

/// Returns what is known of each code.
fn rows(sites: &[Site]) -> BTreeMap<String, CodeRow> {
    let mut rows = BTreeMap::<String, CodeRow>::new();
    for site in sites {
        let row = rows.entry(site.code.clone()).or_default();
        row.kinds.extend(site.kinds.clone());
        row.messages.extend(site.messages.iter().filter(|message| says_something(message)).cloned());
    }
    rows
}

/// True if a message has words of its own besides what is put in.
fn says_something(message: &str) -> bool {
    let mut depth = 0;
    message.chars().any(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        depth == 0 && c.is_alphabetic()
    })
}

fn meaning(code: &str) -> Option<&'static str> {
    MEANINGS.iter().find(|(of, _)| *of == code).map(|(_, meaning)| *meaning)
}

fn exit_code(kind: &str) -> Option<u8> {
    Kind::ALL.iter().find(|known| format!("{known:?}") == kind).map(|known| known.exit_code())
}

/// Returns what is wrong with the use of codes.
fn faults(sites: &[Site]) -> Vec<String> {
    let mut out = Vec::new();
    for (code, row) in rows(sites) {
        let places: Vec<&Site> = sites.iter().filter(|site| site.code == code).collect();
        if places.iter().any(|place| place.kinds.is_disjoint(&places[0].kinds)) {
            out.push(format!("{code} has one kind here and another there: {places:#?}"));
        }
        let differs = places.iter().any(|place| place.messages != places[0].messages);
        let several = differs && meaning(&code).is_none();
        if several {
            out.push(format!(
                "{code} is used in several places with different messages; give one of them another code, or say in \
                 MEANINGS what they have in common: {:?}",
                row.messages
            ));
        }
        if row.messages.is_empty() && meaning(&code).is_none() {
            out.push(format!("{code} has no message of its own; say in MEANINGS what it means"));
        }
        for kind in row.kinds.iter().filter(|kind| exit_code(kind).is_none()) {
            out.push(format!("{code}: no kind of error is called {kind}"));
        }
        let group = code.split('-').nth(1).unwrap_or_default();
        if !GROUPS.iter().any(|(name, _)| *name == group) {
            out.push(format!("{code}: GROUPS has no heading for {group}"));
        }
    }
    let rows = rows(sites);
    let unused = MEANINGS.iter().filter(|(code, _)| !rows.contains_key(*code));
    out.extend(unused.map(|(code, _)| format!("{code} is in MEANINGS and nowhere else")));
    out
}

/// Returns the file.
fn written(rows: &BTreeMap<String, CodeRow>) -> String {
    let mut out = HEAD.to_owned();
    for (group, heading) in GROUPS {
        let inside = |code: &str| code.split('-').nth(1) == Some(group);
        // Writing to a string cannot fail.
        let _ = writeln!(out, "[{group}] {heading}");
        for (code, row) in rows.iter().filter(|(code, _)| inside(code)) {
            let exits: BTreeSet<u8> = row.kinds.iter().filter_map(|kind| exit_code(kind)).collect();
            let exits = exits.iter().map(u8::to_string).collect::<Vec<_>>().join(",");
            for wording in wordings(code, row) {
                let _ = writeln!(out, "{code} {exits} {wording}");
            }
        }
    }
    out
}

/// Returns the meaning of a code where `MEANINGS` has one, else its messages.
fn wordings(code: &str, row: &CodeRow) -> Vec<String> {
    meaning(code).map_or_else(|| row.messages.iter().cloned().collect(), |meaning| vec![meaning.to_owned()])
}

#[test]
fn the_file_is_what_the_sources_say() {
    let (sites, _) = sites(&Sources::read());
    let new = written(&rows(&sites));
    if std::env::var_os("VGS_WRITE_ERROR_CODES").is_some_and(|v| v == "1") {
        std::fs::write(file(), &new).expect("writing codes.txt of `vgs explain`");
    }
    let old = std::fs::read_to_string(file()).unwrap_or_default();
    let first = new.lines().zip(old.lines().chain(std::iter::repeat(""))).find(|(new, old)| new != old);
    assert!(
        new == old,
        "codes.txt of `vgs explain` is out of date; VGS_WRITE_ERROR_CODES=1 writes it anew. The first line that differs, as it \
         should be and as it is: {first:?}"
    );
}

#[test]
fn a_code_means_one_thing() {
    let (sites, unread) = sites(&Sources::read());
    assert!(sites.len() > 200, "the sources were found");
    assert!(
        unread.is_empty(),
        "these codes cannot be read; write Error::new(Kind::X, \"CODE\", message), or a helper near by: {unread:#?}"
    );
    let faults = faults(&sites);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The reader itself, on the ways to make an error.
#[test]
fn errors_are_read_from_sources() {
    let read = |source: &str| sites(&Sources::of(source));
    for (source, kinds, messages) in [
        (r#"Error::new(Kind::Io, "VGS-A-001", "text")"#, vec!["Io"], vec!["text"]),
        (
            r#"Error::new(engine::Kind::Io, "VGS-A-001", format!("a {} {b:.1} {{c}}", 1)).file(x)"#,
            vec!["Io"],
            vec!["a … {b} {c}"],
        ),
        (
            "fn f() { let m = \"one\"; Error::new(Kind::Io, \"VGS-A-001\", m); let m = \"two\"; }",
            vec!["Io"],
            vec!["one"],
        ),
        (
            r#"fn f() { let (k, m) = if a { (Kind::Io, format!("x {a}")) } else { (Kind::Usage, format!("y")) };
               Error::new(k, "VGS-A-001", m) }"#,
            vec!["Io", "Usage"],
            vec!["x {a}", "y"],
        ),
        (
            r#"fn bad(code: &'static str, m: &str) -> Error { Error::new(Kind::BadData, code, m) } fn f() { bad("VGS-A-001", "t") }"#,
            vec!["BadData"],
            vec!["t"],
        ),
        (
            r#"fn f() { let no = |why: &str| Error::new(Kind::Usage, "VGS-A-001", format!("{why}").as_str()); no("a"); }"#,
            vec!["Usage"],
            vec!["{why}"],
        ),
        (
            r#"fn f() { let no = |why: String| Error::new(Kind::Usage, "VGS-A-001", why); no("a".into()); no(format!("b")) }"#,
            vec!["Usage"],
            vec!["a", "b"],
        ),
        (
            "fn f() { let m = match x { None => \"none\", Some(_) => \"some \\\n    more\" }; Error::new(Kind::Io, \"VGS-A-001\", m) }",
            vec!["Io"],
            vec!["none", "some more"],
        ),
    ] {
        let (found, unread) = read(source);
        assert!(unread.is_empty() && found.len() == 1, "{source}: {found:?} {unread:?}");
        assert_eq!(found[0].kinds.iter().map(String::as_str).collect::<Vec<_>>(), kinds, "{source}");
        assert_eq!(found[0].messages.iter().map(String::as_str).collect::<Vec<_>>(), messages, "{source}");
    }
    for none in [
        r#"// Error::new(Kind::Io, "VGS-A-001", "text")"#,
        r#"#[cfg(test)] mod tests { fn f() { assert_eq!(e.code, "VGS-A-001"); } }"#,
        r#"fn f() { e.code == "VGS-A-001" }"#,
        r##"const A: &str = r#"VGS-A-001"#; let l: &'static str = "x"; let q = '"';"##,
    ] {
        assert_eq!(read(none), (vec![], vec![]), "{none}");
    }
    let (_, unread) = read(r#"fn f() { strange("VGS-A-001", "text") }"#);
    assert_eq!(unread.len(), 1, "what cannot be read is told");
}

/// The rules themselves, on codes that break them.
#[test]
fn a_code_with_two_meanings_is_found() {
    let found = |source: &str| {
        let (sites, _) = sites(&Sources::of(source));
        faults(&sites).into_iter().filter(|fault| fault.starts_with("VGS-CLI-999")).collect::<Vec<_>>()
    };
    let two = |second: &str| {
        found(&format!(r#"fn f() {{ Error::new(Kind::Io, "VGS-CLI-999", "one"); Error::new({second}); }}"#))
    };
    assert_eq!(two(r#"Kind::Io, "VGS-CLI-999", "one""#), Vec::<String>::new());
    assert!(two(r#"Kind::Io, "VGS-CLI-999", "other""#)[0].contains("different messages"));
    assert!(two(r#"Kind::Usage, "VGS-CLI-999", "one""#)[0].contains("one kind here"));
    assert!(
        found(r#"fn f(why: String) { Error::new(Kind::Io, "VGS-CLI-999", why); }"#)[0].contains("no message")
    );
}
