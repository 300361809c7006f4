//! Rust as tokens: enough to find calls, their arguments and literals.

use std::ops::Range;

/// A piece of Rust.
#[derive(Clone, Debug, PartialEq)]
pub enum Token {
    /// A name, a keyword or a number.
    Word(String),
    /// The value of a string literal.
    Text(String),
    /// Anything else, letter by letter.
    Sign(char),
}

use Token::{Sign, Text, Word};

/// Returns the tokens of a source without its comments.
pub fn tokens(source: &str) -> Vec<Token> {
    let letters: Vec<char> = source.chars().collect();
    let at = |i: usize| letters.get(i).copied().unwrap_or('\0');
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut out = Vec::new();
    let mut i = 0;
    while i < letters.len() {
        let c = at(i);
        if c == '/' && at(i + 1) == '/' {
            while i < letters.len() && at(i) != '\n' {
                i += 1;
            }
        } else if c == '/' && at(i + 1) == '*' {
            i += 2;
            while i < letters.len() && !(at(i) == '*' && at(i + 1) == '/') {
                i += 1;
            }
            i += 2;
        } else if c == '"' {
            let (text, end) = literal(&letters, i + 1);
            out.push(Text(text));
            i = end;
        } else if (c == 'r' || c == 'b' && at(i + 1) == 'r') && raw(&letters, i).is_some() {
            let (text, end) = raw(&letters, i).expect("a raw literal");
            out.push(Text(text));
            i = end;
        } else if c == '\'' {
            // A letter, or else a lifetime.
            if at(i + 1) == '\\' {
                i += 3;
                while i < letters.len() && at(i) != '\'' {
                    i += 1;
                }
                i += 1;
            } else if at(i + 2) == '\'' {
                i += 3;
            } else {
                i += 1;
            }
        } else if is_word(c) {
            let start = i;
            while is_word(at(i)) {
                i += 1;
            }
            out.push(Word(letters[start..i].iter().collect()));
        } else {
            if !c.is_whitespace() {
                out.push(Sign(c));
            }
            i += 1;
        }
    }
    out
}

/// Returns the value of the literal that begins at `i`, and where it ends.
fn literal(letters: &[char], mut i: usize) -> (String, usize) {
    let mut text = String::new();
    while i < letters.len() && letters[i] != '"' {
        if letters[i] != '\\' {
            text.push(letters[i]);
            i += 1;
            continue;
        }
        match letters.get(i + 1) {
            Some('\n') => {
                i += 2;
                while i < letters.len() && letters[i].is_whitespace() {
                    i += 1;
                }
                continue;
            }
            Some('n') => text.push(' '),
            Some('u') => {
                let digits: String = letters[i + 3..].iter().take_while(|c| **c != '}').collect();
                text.extend(u32::from_str_radix(&digits, 16).ok().and_then(char::from_u32));
                i += 2 + digits.len();
            }
            Some(&other) => text.push(other),
            None => {}
        }
        i += 2;
    }
    (text, i + 1)
}

/// Returns the raw literal that begins at `i`, if one does, and where it ends.
fn raw(letters: &[char], i: usize) -> Option<(String, usize)> {
    let start = i + letters[i..].iter().take_while(|c| matches!(c, 'b' | 'r')).count();
    let hashes = letters[start..].iter().take_while(|c| **c == '#').count();
    let open = start + hashes;
    if letters.get(open) != Some(&'"') {
        return None;
    }
    let closes = |j: usize| letters[j] == '"' && (1..=hashes).all(|k| letters.get(j + k) == Some(&'#'));
    let end = (open + 1..letters.len()).find(|&j| closes(j))?;
    Some((letters[open + 1..end].iter().collect(), end + 1 + hashes))
}

/// Returns the place of the bracket that closes the one at `open`.
pub fn closing(tokens: &[Token], open: usize) -> usize {
    let mut depth = 0;
    for (i, token) in tokens.iter().enumerate().skip(open) {
        match token {
            Sign('(' | '[' | '{') => depth += 1,
            Sign(')' | ']' | '}') => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return i;
        }
    }
    tokens.len()
}

/// Returns the tokens without what is compiled for tests alone.
pub fn without_tests(tokens: &[Token]) -> Vec<Token> {
    let attribute =
        [Sign('#'), Sign('['), Word("cfg".into()), Sign('('), Word("test".into()), Sign(')'), Sign(']')];
    let mut out = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        if tokens[i..].starts_with(&attribute) {
            let rest = i + attribute.len();
            let ends = |t: &Token| matches!(t, Sign(';' | '{'));
            let end = tokens[rest..].iter().position(ends).map_or(tokens.len(), |n| rest + n);
            i = 1 + if tokens.get(end) == Some(&Sign('{')) { closing(tokens, end) } else { end };
        } else {
            out.push(tokens[i].clone());
            i += 1;
        }
    }
    out
}

/// Returns where the statement or function that begins at `start` ends.
pub fn statement_end(tokens: &[Token], start: usize) -> usize {
    let is_function = tokens[start] == Word("fn".into());
    let mut i = start;
    while i < tokens.len() {
        match tokens[i] {
            Sign('{') if is_function => return closing(tokens, i),
            Sign('(' | '[' | '{') => i = closing(tokens, i),
            Sign(';') => return i,
            _ => {}
        }
        i += 1;
    }
    tokens.len()
}

/// Returns the ranges of the arguments between two brackets.
pub fn arguments(tokens: &[Token], open: usize) -> Vec<Range<usize>> {
    let close = closing(tokens, open);
    let (mut out, mut start, mut i) = (Vec::new(), open + 1, open + 1);
    while i < close {
        match tokens[i] {
            Sign('(' | '[' | '{') => i = closing(tokens, i),
            Sign(',') => {
                out.push(start..i);
                start = i + 1;
            }
            _ => {}
        }
        i += 1;
    }
    if start < close {
        out.push(start..close);
    }
    out
}

/// Returns the bracket that stands open around a token.
pub fn around(tokens: &[Token], at: usize) -> Option<usize> {
    let mut depth = 0;
    for i in (0..at).rev() {
        match tokens[i] {
            Sign(')' | ']' | '}') => depth += 1,
            Sign('(' | '[' | '{') if depth == 0 => return Some(i),
            Sign('(' | '[' | '{') => depth -= 1,
            _ => {}
        }
    }
    None
}
