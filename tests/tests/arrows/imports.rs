//! Which file of a crate uses which, and where files use each other in a circle.
//!
//! A name that a file re-exports stands for the file that defines it: `use super::Scene` is an arrow to
//! `scene.rs` where the `mod.rs` above only says `pub use scene::Scene`. So a front file that is a pure map
//! is in nobody's way. Tests are left out: they may use anything.

use std::collections::{BTreeMap, BTreeSet};

/// A path as it stands in the code, such as ["super", "scene", "Scene"].
type Path = Vec<String>;

/// One name that a `use` statement brings into a file.
struct Import {
    /// What is written.
    path: Path,
    /// The name it has in the file; "*" for all names of a module.
    name: String,
    /// True if the name is passed on (`pub use`): then the file that passes it on does not use it itself.
    passed_on: bool,
}

/// A file of a crate.
struct Source {
    file: String,
    imports: Vec<Import>,
    /// Paths with two or more parts outside of `use` statements.
    paths: Vec<Path>,
}

/// The files of a crate by their module paths.
pub struct Crate {
    modules: BTreeMap<Path, Source>,
}

impl Crate {
    /// Reads the crate whose sources lie in `folder` out of `files` (path from the root, content).
    pub fn new(folder: &str, files: &[(String, String)]) -> Self {
        let library = files.iter().any(|(file, _)| *file == format!("{folder}/lib.rs"));
        let mut modules = BTreeMap::new();
        for (file, text) in files {
            let Some(inner) = file.strip_prefix(&format!("{folder}/")) else { continue };
            let tests = inner.ends_with("/tests.rs") || inner == "tests.rs" || inner.contains("tests/");
            // The program beside a library is another crate.
            if tests || library && inner == "main.rs" {
                continue;
            }
            let (imports, paths) = parse(&without_tests(text));
            modules.insert(module_path(inner), Source { file: file.clone(), imports, paths });
        }
        Crate { modules }
    }

    /// Returns the number of files.
    pub fn len(&self) -> usize {
        self.modules.len()
    }

    /// Returns for every file the files that it uses.
    pub fn arrows(&self) -> BTreeMap<&str, BTreeSet<&str>> {
        let mut arrows = BTreeMap::new();
        for (module, source) in &self.modules {
            let imported =
                source.imports.iter().filter(|import| !import.passed_on).map(|import| &import.path);
            let used = imported.chain(&source.paths).filter_map(|path| self.resolve(module, path, 0));
            arrows.insert(source.file.as_str(), used.filter(|file| *file != source.file).collect());
        }
        arrows
    }

    /// Returns the groups of files that use each other in a circle.
    pub fn circles(&self) -> Vec<BTreeSet<&str>> {
        let arrows = self.arrows();
        let reach: BTreeMap<&str, BTreeSet<&str>> =
            arrows.keys().map(|file| (*file, reachable(&arrows, file))).collect();
        let mut circles: Vec<BTreeSet<&str>> = Vec::new();
        for (file, others) in reach.iter().filter(|(file, others)| others.contains(*file)) {
            if !circles.iter().any(|circle| circle.contains(file)) {
                circles.push(others.iter().copied().filter(|other| reach[other].contains(file)).collect());
            }
        }
        circles
    }

    /// Returns the file that defines what `path` means inside `module`; nothing if that is another crate's.
    fn resolve(&self, module: &[String], path: &[String], depth: usize) -> Option<&str> {
        let (head, mut rest) = path.split_first()?;
        let mut at = module.to_vec();
        match head.as_str() {
            "crate" => at.clear(),
            "self" => {}
            "super" => {
                at.pop()?;
                while rest.first().is_some_and(|part| part == "super") {
                    at.pop()?;
                    rest = &rest[1..];
                }
            }
            _ => return self.named(module, path, depth),
        }
        match rest.first() {
            Some(_) => self.named(&at, rest, depth).or_else(|| Some(self.modules.get(&at)?.file.as_str())),
            None => Some(self.modules.get(&at)?.file.as_str()),
        }
    }

    /// Returns the file that defines what `path` means, whose first part is a child of `module` or a name
    /// that it imports.
    fn named(&self, module: &[String], path: &[String], depth: usize) -> Option<&str> {
        let (head, rest) = path.split_first()?;
        let mut child = module.to_vec();
        child.push(head.clone());
        if let Some(source) = self.modules.get(&child) {
            return match rest.first() {
                Some(_) => self.named(&child, rest, depth).or(Some(source.file.as_str())),
                None => Some(source.file.as_str()),
            };
        }
        let import = self.modules.get(module)?.imports.iter().find(|import| import.name == *head)?;
        let whole: Path = import.path.iter().chain(rest).cloned().collect();
        // A name may pass through a few front files, and `use foo::foo` names itself.
        if depth < 8 { self.resolve(module, &whole, depth + 1) } else { None }
    }
}

/// Returns what can be reached from a file along one arrow or more.
fn reachable<'a>(arrows: &BTreeMap<&'a str, BTreeSet<&'a str>>, from: &str) -> BTreeSet<&'a str> {
    let mut found: BTreeSet<&str> = BTreeSet::new();
    let mut open: Vec<&str> = arrows[from].iter().copied().collect();
    while let Some(file) = open.pop() {
        if found.insert(file) {
            open.extend(&arrows[file]);
        }
    }
    found
}

/// Returns the module path of a file, given from its source folder: ["fit", "init"] of `fit/init/mod.rs`.
fn module_path(inner: &str) -> Path {
    let path = inner.trim_end_matches(".rs");
    let path = path.strip_suffix("/mod").unwrap_or(path);
    path.split('/').filter(|part| !["lib", "main"].contains(part)).map(str::to_owned).collect()
}

/// Returns the code of a file without comments and without its inline test modules.
fn without_tests(text: &str) -> String {
    let mut out = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line == "#[cfg(test)]" {
            let next = lines.next().unwrap_or_default();
            if next.ends_with('{') {
                lines.by_ref().find(|line| *line == "}");
            }
            continue;
        }
        out.push_str(line.split("//").next().unwrap_or_default());
        out.push('\n');
    }
    out
}

/// Returns the imports and the other paths of some code.
fn parse(code: &str) -> (Vec<Import>, Vec<Path>) {
    let (mut imports, mut paths) = (Vec::new(), Vec::new());
    let mut rest = String::new();
    let mut statement: Option<String> = None;
    for line in code.lines() {
        let trimmed = line.trim();
        let begins = ["use ", "pub use ", "pub(crate) use ", "pub(super) use "]
            .iter()
            .any(|word| trimmed.starts_with(word));
        if statement.is_none() && !begins {
            rest.push_str(line);
            rest.push('\n');
            continue;
        }
        let whole = statement.take().unwrap_or_default() + " " + trimmed;
        if !trimmed.ends_with(';') {
            statement = Some(whole);
            continue;
        }
        let (visible, tree) = whole.split_once("use ").expect("a use statement");
        let passed_on = visible.contains("pub");
        for (path, name) in leaves(tree.trim_end_matches(';'), &[]) {
            imports.push(Import { path, name, passed_on });
        }
    }
    let letter = |c: char| c.is_alphanumeric() || c == '_';
    for piece in rest.split(|c: char| !letter(c) && c != ':').filter(|piece| piece.contains("::")) {
        let parts: Path = piece.trim_matches(':').split("::").map(str::to_owned).collect();
        if parts.len() > 1 && parts.iter().all(|part| part.starts_with(letter)) {
            paths.push(parts);
        }
    }
    (imports, paths)
}

/// Returns the paths of a use tree such as `a::{b, c::{d, e as f}}`, each with the name that it gets.
fn leaves(tree: &str, before: &[String]) -> Vec<(Path, String)> {
    let tree = tree.trim();
    let mut path = before.to_vec();
    let Some((head, group)) = tree.split_once('{') else {
        let (whole, alias) =
            tree.split_once(" as ").map_or((tree, None), |(whole, name)| (whole, Some(name)));
        path.extend(whole.split("::").map(|part| part.trim().to_owned()));
        if path.len() > 1 && path.last().is_some_and(|part| part == "self") {
            path.pop();
        }
        let name =
            alias.map_or_else(|| path.last().cloned().unwrap_or_default(), |name| name.trim().to_owned());
        if name == "*" {
            path.pop();
        }
        return vec![(path, name)];
    };
    path.extend(
        head.trim_end()
            .trim_end_matches("::")
            .split("::")
            .filter(|part| !part.is_empty())
            .map(|part| part.trim().to_owned()),
    );
    let (mut depth, mut start, mut out) = (0, 0, Vec::new());
    let group = group.trim_end().strip_suffix('}').unwrap_or(group);
    for (i, c) in group.char_indices().chain([(group.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                if !group[start..i].trim().is_empty() {
                    out.extend(leaves(&group[start..i], &path));
                }
                start = i + 1;
            }
            _ => {}
        }
    }
    out
}

#[test]
fn circles_are_found() {
    let made = |files: &[(&str, &str)]| -> Vec<(String, String)> {
        files.iter().map(|(file, text)| (format!("made/{file}"), (*text).to_owned())).collect()
    };
    // Two files that need each other through a front file that is a map.
    let map = "mod a;\nmod b;\n\npub use a::{Alpha, other as renamed};\npub use b::Beta;\n";
    for (a, b, circles) in [
        ("use super::Beta;", "pub struct Beta;", 0),
        ("use super::Beta;", "use super::Alpha;", 1),
        ("use super::b::Beta;", "fn f() -> crate::inner::Alpha {}", 1),
        ("use super::{\n    b::{self, Beta},\n};", "use super::renamed;", 1),
        ("use super::Beta;", "// use super::Alpha;", 0),
        ("use super::Beta;", "#[cfg(test)]\nmod tests {\n    use super::super::Alpha;\n}", 0),
        ("use super::Beta;", "use outer::inner::Alpha;", 0),
        ("fn f(_: super::Beta) {}", "fn f() { super::a::g::<u8>() }", 1),
    ] {
        let files =
            made(&[("lib.rs", "mod inner;"), ("inner/mod.rs", map), ("inner/a.rs", a), ("inner/b.rs", b)]);
        let found = Crate::new("made", &files);
        assert_eq!(found.circles().len(), circles, "{a} {b}: {:?}", found.arrows());
    }
    // A front file that is more than a map is in a circle with a child that needs it.
    let files = made(&[
        ("lib.rs", "mod a;\npub struct Whole(a::Part);"),
        ("a.rs", "use super::Whole;\npub struct Part;"),
    ]);
    assert_eq!(Crate::new("made", &files).circles(), [BTreeSet::from(["made/a.rs", "made/lib.rs"])]);
}
