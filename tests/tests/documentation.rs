//! The documentation is as it claims: links lead somewhere, the glossary names what is there, the README shows code that
//! runs.

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository").to_owned()
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Returns all pages: those beside the README and those below docs/.
fn pages() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![root().join("docs")];
    let mut take = |folder: &Path, deeper: Option<&mut Vec<PathBuf>>| {
        let mut folders = Vec::new();
        for entry in std::fs::read_dir(folder).expect("a readable folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                found.push(path);
            }
        }
        if let Some(deeper) = deeper {
            deeper.extend(folders);
        }
    };
    take(&root(), None);
    while let Some(folder) = open.pop() {
        take(&folder, Some(&mut open));
    }
    found.sort();
    found
}

/// Returns the targets of the links of a page, without those of its code.
fn links(text: &str) -> Vec<&str> {
    let prose = text.split("```").step_by(2);
    let targets = prose.flat_map(|part| part.split("](").skip(1));
    targets.filter_map(|rest| rest.split_once(')').map(|(target, _)| target)).collect()
}

/// Returns the anchors of the headings of a page, as GitHub makes them.
fn anchors(text: &str) -> Vec<String> {
    let headings = text.split("```").step_by(2).flat_map(str::lines).filter(|line| line.starts_with('#'));
    let anchor = |heading: &str| -> String {
        let words = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = words.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    headings.map(anchor).collect()
}

#[test]
fn links_lead_somewhere() {
    let pages = pages();
    assert!(pages.len() > 12, "the pages were found");
    for page in pages {
        let text = read(&page);
        for link in links(&text).into_iter().filter(|link| !link.contains("://")) {
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target =
                if path.is_empty() { page.clone() } else { page.parent().expect("a folder").join(path) };
            assert!(target.exists(), "{}: {link} leads nowhere", page.display());
            if !anchor.is_empty() && target.extension().is_some_and(|e| e == "md") {
                let there = anchors(&read(&target));
                assert!(there.iter().any(|a| a == anchor), "{}: no heading {link}", page.display());
            }
        }
    }
}

#[test]
fn the_glossary_names_what_is_there() {
    let glossary = read(&root().join("docs/glossary.md"));
    let rows: Vec<Vec<&str>> = glossary
        .lines()
        .filter(|line| line.starts_with("| ") && line.contains("](../"))
        .map(|line| line.trim_matches('|').split(" | ").map(str::trim).collect())
        .collect();
    assert!(rows.len() > 40, "the rows were found");
    for row in rows {
        let [term, _, name, file] = row[..] else { panic!("{row:?} has four columns") };
        let path = links(file)[0].trim_start_matches("../");
        let name = name.trim_matches('`');
        let text = read(&root().join(path));
        let there = text.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == name);
        let is_module = path.split(['/', '.']).any(|part| part == name);
        assert!(there || is_module, "{term}: {path} has no {name}");
    }
}

#[test]
fn the_readme_shows_the_first_example() {
    let example = "tools/python/examples/first.py";
    let (readme, text) = (read(&root().join("README.md")), read(&root().join(example)));
    let code: String = text.split_inclusive('\n').skip_while(|line| line.starts_with("\"\"\"")).collect();
    assert!(readme.contains(code.trim()), "README.md has the code of {example} as it stands");
}
