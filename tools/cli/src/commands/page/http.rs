//! Requests of HTTP/1.1 and the answers to them: one page, at `/`.

use std::fmt::Write as _;

/// Most bytes of the head of a request.
pub const MOST_HEAD: usize = 8 << 10;

/// Who may ask: a page of another site that gets a name to mean this machine must not read the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hosts {
    /// This machine, by its names for itself.
    Loopback,
    /// Anybody: a certificate says who this machine is.
    Any,
}

impl Hosts {
    /// Returns true if a request for this host, with or without a port, is meant for this machine.
    fn has(self, host: &str) -> bool {
        if self == Hosts::Any {
            return true;
        }
        let name = match host.strip_prefix('[') {
            Some(rest) => rest.split(']').next(),
            None => host.split(':').next(),
        };
        let name = name.unwrap_or_default();
        let is_loopback = name.parse().is_ok_and(|address: std::net::IpAddr| address.is_loopback());
        is_loopback || name.eq_ignore_ascii_case("localhost")
    }
}

/// What is said to a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The page, or its head alone.
    Page {
        /// True if it was asked for the head alone.
        head_only: bool,
    },
    /// Something else, by its status.
    Refusal(&'static str),
}

/// Status of a request that came too slowly.
pub const TOO_SLOW: &str = "408 Request Timeout";
/// Status of a request whose head is too long.
pub const TOO_LONG: &str = "431 Request Header Fields Too Large";
/// Status where there are too many requests at a time.
pub const TOO_MANY: &str = "503 Service Unavailable";

/// Returns what is said to a request with this head, which ends with an empty line.
pub fn answer(head: &[u8], hosts: Hosts) -> Answer {
    const BAD: Answer = Answer::Refusal("400 Bad Request");
    let Ok(head) = std::str::from_utf8(head) else { return BAD };
    let mut lines = head.split("\r\n");
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (Some(method), Some(target), Some(version), None) =
        (words.next(), words.next(), words.next(), words.next())
    else {
        return BAD;
    };
    if !version.starts_with("HTTP/1.") {
        return Answer::Refusal("505 HTTP Version Not Supported");
    }
    let mut asked = lines.filter_map(|line| line.split_once(':'));
    let mut host = asked.by_ref().filter(|(name, _)| name.eq_ignore_ascii_case("host"));
    let (Some((_, host)), None) = (host.next(), host.next()) else { return BAD };
    if !hosts.has(host.trim()) {
        return Answer::Refusal("421 Misdirected Request");
    }
    match (method, target.split(['?', '#']).next()) {
        ("GET" | "HEAD", Some("/")) => Answer::Page { head_only: method == "HEAD" },
        ("GET" | "HEAD", _) => Answer::Refusal("404 Not Found"),
        _ => Answer::Refusal("405 Method Not Allowed"),
    }
}

/// Returns the bytes that go before the body of an answer, and for a refusal the whole.
pub fn head(answer: Answer, page_bytes: usize) -> String {
    let (status, kind, length) = match answer {
        Answer::Page { .. } => ("200 OK", "text/html; charset=utf-8", page_bytes),
        Answer::Refusal(status) => (status, "text/plain; charset=utf-8", status.len() + 1),
    };
    let mut out = format!("HTTP/1.1 {status}\r\n");
    let fields = [
        ("Content-Type", kind),
        ("X-Content-Type-Options", "nosniff"),
        ("Cache-Control", "no-store"),
        ("Referrer-Policy", "no-referrer"),
        ("Cross-Origin-Resource-Policy", "same-origin"),
        ("Cross-Origin-Opener-Policy", "same-origin"),
        // Pages of other sites must not show it within theirs, where they could watch it.
        ("Content-Security-Policy", "frame-ancestors 'none'"),
        ("X-Frame-Options", "DENY"),
        ("Connection", "close"),
    ];
    for (name, value) in fields {
        // Writing to a string cannot fail.
        let _ = write!(out, "{name}: {value}\r\n");
    }
    if answer == Answer::Refusal("405 Method Not Allowed") {
        out.push_str("Allow: GET, HEAD\r\n");
    }
    let _ = write!(out, "Content-Length: {length}\r\n\r\n");
    if let Answer::Refusal(status) = answer {
        out.push_str(status);
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_at_the_root_and_nothing_else_is_anywhere() {
        let ask = |line: &str, host: &str| {
            answer(
                format!("{line} HTTP/1.1\r\nAccept: */*\r\nhost: {host}\r\n\r\n").as_bytes(),
                Hosts::Loopback,
            )
        };
        let page = |head_only| Answer::Page { head_only };
        for host in ["localhost:8787", "LOCALHOST", "127.0.0.1", "127.0.0.1:80", "[::1]:8787", "[::1]"] {
            assert_eq!(ask("GET /", host), page(false), "{host}");
        }
        assert_eq!(ask("HEAD /?view=1", "localhost"), page(true));
        for (line, host, status) in [
            ("GET /scene.html", "localhost", "404"),
            ("GET /../etc/passwd", "localhost", "404"),
            ("GET //", "localhost", "404"),
            ("POST /", "localhost", "405"),
            ("OPTIONS *", "localhost", "405"),
            ("GET /", "evil.example", "421"),
            ("GET /", "127.0.0.1.evil.example", "421"),
            ("GET /", "localhost.evil.example:8787", "421"),
            ("GET /", "", "421"),
            ("GET  /", "localhost", "400"),
            ("GET", "localhost", "400"),
        ] {
            let Answer::Refusal(said) = ask(line, host) else { panic!("{line} of {host} is answered") };
            assert!(said.starts_with(status), "{line} of {host}: {said}");
        }
        for head in ["", "\r\n\r\n", "GET / HTTP/1.1\r\n\r\n", "GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n"]
        {
            assert_eq!(answer(head.as_bytes(), Hosts::Any), Answer::Refusal("400 Bad Request"), "{head:?}");
        }
        let newer = answer(b"GET / HTTP/2\r\nHost: a\r\n\r\n", Hosts::Any);
        assert_eq!(newer, Answer::Refusal("505 HTTP Version Not Supported"));
        assert_eq!(answer(b"GET / HTTP/1.1\r\nHost: a\r\n\r\n", Hosts::Any), page(false));
        assert_eq!(answer(b"\xff", Hosts::Any), Answer::Refusal("400 Bad Request"));
    }

    #[test]
    fn answers_say_what_they_are() {
        let whole = head(Answer::Page { head_only: false }, 77);
        for line in [
            "HTTP/1.1 200 OK",
            "Content-Type: text/html; charset=utf-8",
            "Content-Length: 77",
            "X-Content-Type-Options: nosniff",
            "Cache-Control: no-store",
            "Content-Security-Policy: frame-ancestors 'none'",
            "X-Frame-Options: DENY",
        ] {
            assert!(whole.contains(&format!("{line}\r\n")), "{line}: {whole}");
        }
        assert!(whole.ends_with("\r\n\r\n"));
        let refusal = head(Answer::Refusal("405 Method Not Allowed"), 77);
        assert!(
            refusal.contains("Allow: GET, HEAD\r\n") && refusal.contains("Content-Length: 23\r\n"),
            "{refusal}"
        );
        assert!(refusal.ends_with("\r\n\r\n405 Method Not Allowed\n"));
    }
}
