//! The places in the sources that make errors.
//!
//! An error is made in one of two ways: `Error::new(Kind::X, "CODE", message)`, or a helper `bad("CODE", message)` whose
//! definition, in the same file, in its folder or above, names the kind. A message is a literal, a `format!`, a variable that
//! is one of these a few lines before, or a parameter that the calls of a function give.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::tokens::Token::{self, Sign, Text, Word};
use super::tokens::{arguments, around, closing, statement_end, tokens, without_tests};

/// The folders whose sources are read.
const FOLDERS: [&str; 8] = [
    "engine",
    "tools/view/src",
    "tools/cli/src",
    "tools/page/src",
    "tools/python/src",
    "xr-app/src",
    "tools/research/bench/src",
    "tools/research/studies/src",
];
/// How often a message is followed from a variable to its value.
const DEPTH: usize = 3;

/// One place that makes an error.
#[derive(Clone, Debug, PartialEq)]
pub struct Site {
    /// Such as `VGS-NII-012`.
    pub code: String,
    /// Names of the kinds that it can have.
    pub kinds: BTreeSet<String>,
    /// The messages, with names in braces for what is put in.
    pub messages: BTreeSet<String>,
    /// The source, from the root.
    pub file: String,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the repository").to_owned()
}

/// The sources, by their path from the root.
pub struct Sources(pub BTreeMap<String, Vec<Token>>);

impl Sources {
    /// Reads all sources of the workspace that are no tests.
    pub fn read() -> Self {
        let mut files = BTreeMap::new();
        let mut open: Vec<PathBuf> = FOLDERS.iter().map(|folder| root().join(folder)).collect();
        while let Some(folder) = open.pop() {
            for entry in std::fs::read_dir(&folder).expect("a folder of sources") {
                let path = entry.expect("a readable folder").path();
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                if path.is_dir() && name != "tests" {
                    open.push(path);
                } else if name.ends_with(".rs") && name != "tests.rs" {
                    let source = std::fs::read_to_string(&path).expect("UTF-8");
                    let relative = path.strip_prefix(root()).expect("below the root").to_string_lossy();
                    files.insert(relative.replace('\\', "/"), without_tests(&tokens(&source)));
                }
            }
        }
        Sources(files)
    }

    /// Returns one source as if it were all.
    pub fn of(source: &str) -> Self {
        Sources(BTreeMap::from([("a/b.rs".to_owned(), without_tests(&tokens(source)))]))
    }

    /// Returns the definition of a helper that a file calls: in the file itself, in its folder, or above.
    fn definition(&self, file: &str, helper: &str) -> Option<&[Token]> {
        let own = self.0.get_key_value(file).into_iter();
        let folders = Path::new(file).ancestors().skip(1);
        let near = folders.flat_map(|folder| {
            self.0.iter().filter(move |(path, _)| Path::new(path).parent() == Some(folder))
        });
        own.chain(near).find_map(|(_, tokens)| {
            let start = defined_at(tokens, helper)?;
            Some(&tokens[start..statement_end(tokens, start)])
        })
    }
}

/// Returns where a function or a closure of this name is defined.
fn defined_at(tokens: &[Token], name: &str) -> Option<usize> {
    let is_definition = |pair: &[Token]| {
        matches!(&pair[0], Word(word) if word == "fn" || word == "let") && pair[1] == Word(name.to_owned())
    };
    tokens.windows(2).position(is_definition)
}

/// Returns the kinds that are named among tokens.
fn kinds(tokens: &[Token]) -> BTreeSet<String> {
    let named = |four: &[Token]| match four {
        [Word(kind), Sign(':'), Sign(':'), Word(name)] if kind == "Kind" => Some(name.clone()),
        _ => None,
    };
    tokens.windows(4).filter_map(named).collect()
}

/// Returns the last statement before `at`, in the blocks around it, that gives a variable its value.
fn value_of<'a>(tokens: &'a [Token], at: usize, variable: &str) -> Option<(usize, &'a [Token])> {
    let mut i = at;
    let mut closed = 0;
    while i > 0 {
        i -= 1;
        match &tokens[i] {
            Sign('}') => closed += 1,
            Sign('{') if closed > 0 => closed -= 1,
            Word(word) if word == "fn" && closed == 0 => return None,
            Word(word) if word == "let" && closed == 0 => {
                let end = statement_end(tokens, i);
                let equals = tokens[i..end].iter().position(|t| *t == Sign('=')).map(|n| i + n)?;
                let named = tokens[i..equals].contains(&Word(variable.to_owned()));
                if named && end <= at {
                    return Some((i, &tokens[i..end]));
                }
            }
            _ => {}
        }
    }
    None
}

/// Returns a format string as people read it: what is put in by name keeps the name.
fn template(text: &str) -> String {
    let (mut out, mut rest) = (String::new(), text);
    while let Some(open) = rest.find(['{', '}']) {
        out += &rest[..open];
        let tail = &rest[open..];
        if tail.starts_with("{{") || tail.starts_with("}}") {
            out.push_str(&tail[..1]);
            rest = &tail[2..];
            continue;
        }
        let end = tail.find('}').unwrap_or(tail.len() - 1);
        let name = tail[1..end.max(1)].split(':').next().unwrap_or_default();
        out += &if name.is_empty() || name.chars().all(|c| c.is_ascii_digit()) {
            "…".into()
        } else {
            format!("{{{name}}}")
        };
        rest = &tail[end + 1..];
    }
    (out + rest).split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Returns the messages that an expression can be. `others` are the files beside.
fn messages(tokens: &[Token], range: Range<usize>, others: &[&[Token]], depth: usize) -> BTreeSet<String> {
    let expression = &tokens[range.clone()];
    let found = literals(expression);
    if !found.is_empty() {
        return found;
    }
    let Some(Word(name)) = expression.iter().find(|t| matches!(t, Word(_))) else { return found };
    let named = BTreeSet::from([format!("{{{name}}}")]);
    if depth == 0 {
        return named;
    }
    if let Some((start, value)) = value_of(tokens, range.start, name) {
        let found = literals(value);
        if !found.is_empty() {
            return found;
        }
        return match value.iter().rposition(|t| *t == Sign('=')) {
            // What another variable is.
            Some(equals) if value.len() - equals <= 3 => {
                messages(tokens, start + equals + 1..start + value.len(), others, depth - 1)
            }
            _ => named,
        };
    }
    let found = given(tokens, range.start, name, others, depth - 1);
    if found.is_empty() { named } else { found }
}

/// Returns the messages among tokens: literals that are a value, and those of `format!`.
fn literals(tokens: &[Token]) -> BTreeSet<String> {
    let before = |i: usize| i.checked_sub(1).map(|k| &tokens[k]);
    let mut found = BTreeSet::new();
    let mut i = 0;
    while i < tokens.len() {
        let is_format =
            matches!(&tokens[i..], [Word(word), Sign('!'), Sign('('), Text(_), ..] if word == "format");
        if is_format {
            if let Text(text) = &tokens[i + 3] {
                found.insert(template(text));
            }
            i = closing(tokens, i + 2);
        } else if let Text(text) = &tokens[i] {
            if matches!(before(i), None | Some(Sign('=' | '>' | '{' | '(' | ','))) {
                found.insert(template(text));
            }
        } else if tokens[i] == Sign('(') && !matches!(before(i), None | Some(Sign('=' | '>' | '{'))) {
            // The arguments of a call are no values of the expression; the parts of a tuple are.
            i = closing(tokens, i);
        }
        i += 1;
    }
    found
}

/// Returns what the calls of the function or closure around `at` give for its parameter `name`. Of a public function the
/// calls in `others` count, too.
fn given(tokens: &[Token], at: usize, name: &str, others: &[&[Token]], depth: usize) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for start in (0..at).rev() {
        let function = match &tokens[start..] {
            [Word(word), Word(function), Sign('('), ..] if word == "fn" => {
                Some((function, arguments(tokens, start + 2)))
            }
            [Word(word), Word(function), Sign('='), Sign('|'), ..] if word == "let" => {
                let open = start + 3;
                let close = tokens[open + 1..].iter().position(|t| *t == Sign('|')).map(|n| open + 1 + n);
                let close = close.unwrap_or(open + 1);
                let ranges =
                    tokens[open + 1..close].split(|t| *t == Sign(',')).scan(open + 1, |from, part| {
                        let range = *from..*from + part.len();
                        *from += part.len() + 1;
                        Some(range)
                    });
                Some((function, ranges.collect()))
            }
            _ => None,
        };
        let Some((function, parameters)) = function else { continue };
        let place =
            parameters.iter().position(|range| tokens[range.clone()].contains(&Word(name.to_owned())));
        let Some(place) = place else {
            if tokens[start] == Word("fn".into()) {
                break;
            }
            continue;
        };
        let public = start > 0
            && (matches!(&tokens[start - 1], Word(word) if word == "pub") || tokens[start - 1] == Sign(')'));
        let users = others.iter().filter(|other| public && defined_at(other, function).is_none());
        for tokens in std::iter::once(tokens).chain(users.copied()) {
            for (i, pair) in tokens.windows(2).enumerate() {
                let calls = pair[0] == Word(function.clone()) && pair[1] == Sign('(');
                let is_definition = i > 0 && tokens[i - 1] == Word("fn".into());
                if let (true, false, Some(range)) =
                    (calls, is_definition, arguments(tokens, i + 1).get(place))
                {
                    found.extend(messages(tokens, range.clone(), others, depth));
                }
            }
        }
        break;
    }
    found
}

/// True if a text is a code.
fn is_code(text: &str) -> bool {
    let parts: Vec<&str> = text.split('-').collect();
    matches!(parts.as_slice(), ["VGS", module, number]
        if module.chars().all(|c| c.is_ascii_uppercase()) && number.len() == 3 && number.parse::<u16>().is_ok())
}

/// Returns every place that makes an error, and the places of codes that cannot be read.
pub fn sites(sources: &Sources) -> (Vec<Site>, Vec<String>) {
    let (mut sites, mut strange) = (Vec::new(), Vec::new());
    for (file, tokens) in &sources.0 {
        for (i, token) in tokens.iter().enumerate() {
            let Text(code) = token else { continue };
            // A code that is compared with, or that has a name to be compared with, is no place that makes one.
            if !is_code(code) || matches!(tokens.get(i.wrapping_sub(1)), Some(Sign('='))) {
                continue;
            }
            match site(sources, file, tokens, i) {
                Some((kinds, messages)) if !kinds.is_empty() => {
                    sites.push(Site { code: code.clone(), kinds, messages, file: file.clone() });
                }
                _ => strange.push(format!("{file}: {code}")),
            }
        }
    }
    (sites, strange)
}

/// Returns kinds and messages of the error whose code is token `i`.
fn site(
    sources: &Sources,
    file: &str,
    tokens: &[Token],
    i: usize,
) -> Option<(BTreeSet<String>, BTreeSet<String>)> {
    let open = around(tokens, i)?;
    let Some(Word(callee)) = tokens.get(open.checked_sub(1)?) else { return None };
    let given = arguments(tokens, open);
    let place = given.iter().position(|range| range.contains(&i))?;
    let folder = Path::new(file).parent();
    let beside = sources.0.iter().filter(|(other, _)| *other != file && Path::new(other).parent() == folder);
    let others: Vec<&[Token]> = beside.map(|(_, tokens)| tokens.as_slice()).collect();
    let message = messages(tokens, given.get(place + 1)?.clone(), &others, DEPTH);
    if callee != "new" {
        return Some((kinds(sources.definition(file, callee)?), message));
    }
    let kind = &tokens[given.first()?.clone()];
    let named = kinds(kind);
    // With `let (kind, message) = ...` the value of one is that of both.
    match kind {
        [Word(variable)] if named.is_empty() => {
            let (_, value) = value_of(tokens, open, variable)?;
            Some((kinds(value), message))
        }
        _ => Some((named, message)),
    }
}
