//! Asks the portal, and takes its answer.

use std::collections::HashMap;
use std::ffi::OsString;
use std::future::poll_fn;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::PathBuf;
use std::pin::Pin;
use std::task::Poll;
use std::time::{Duration, Instant};

use futures_core::Stream;
use zbus::connection::Builder;
use zbus::message::Type;
use zbus::{Connection, Error, MatchRule, MessageStream, OwnedObjectPath, OwnedVariant, Variant};

use crate::model::system_dialog::{Pending, Question, Replier, Reply, Wanted};

const PORTAL: &str = "org.freedesktop.portal.Desktop";
const PATH: &str = "/org/freedesktop/portal/desktop";
const CHOOSER: &str = "org.freedesktop.portal.FileChooser";
const REQUEST: &str = "org.freedesktop.portal.Request";

/// Least version that is used: the first that can ask for a folder.
const VERSION: u32 = 3;
/// Longest time that a portal takes to say that it shows a dialog. The user waits for our own in vain until then.
const LIMIT: Duration = Duration::from_millis(1500);
/// Time before which no user closes a dialog.
const AT_ONCE: Duration = Duration::from_millis(500);

/// Shows the dialog above the window `parent`, as the portal names windows, and returns at once. `wake` is called once
/// the answer is there.
pub fn ask(question: Question, parent: String, wake: impl Fn() + Send + 'static) -> Pending {
    ask_over(Builder::session, question, parent, wake)
}

fn ask_over(
    bus: impl FnOnce() -> Builder<'static> + Send + 'static,
    question: Question,
    parent: String,
    wake: impl Fn() + Send + 'static,
) -> Pending {
    let (pending, replier) = Pending::new();
    std::thread::spawn(move || {
        let reply = zbus::block_on(async {
            let connection = bus().method_timeout(LIMIT).build().await?;
            talk(&connection, &question, &parent, &replier).await
        });
        replier.send(reply.unwrap_or_else(|error| {
            tracing::info!("no desktop file dialog: {error}");
            Reply::Unavailable
        }));
        wake();
    });
    pending
}

async fn talk(
    connection: &Connection,
    question: &Question,
    parent: &str,
    replier: &Replier,
) -> zbus::Result<Reply> {
    let properties = Some("org.freedesktop.DBus.Properties");
    let version =
        connection.call_method(Some(PORTAL), PATH, properties, "Get", &(CHOOSER, "version")).await?;
    let version: u32 = version.body().deserialize::<Variant<'_>>()?.downcast()?;
    if version < VERSION {
        return Err(Error::Failure(format!("version {version} of the portal, {VERSION} is needed")));
    }
    // Any response is taken from here on, since it may come before the call returns which one is meant.
    let rule = MatchRule::builder().msg_type(Type::Signal).sender(PORTAL);
    let rule = rule.interface(REQUEST).member("Response").build()?;
    let mut responses = MessageStream::for_match_rule(rule, connection, None).await?;
    let method = if matches!(question.wanted, Wanted::New(_)) { "SaveFile" } else { "OpenFile" };
    let body = (parent, question.title, options(question));
    let request = connection.call_method(Some(PORTAL), PATH, Some(CHOOSER), method, &body).await?;
    let request: OwnedObjectPath = request.body().deserialize()?;
    let begin = Instant::now();
    loop {
        let next = poll_fn(|context| match replier.poll_dropped(context) {
            Poll::Ready(()) => Poll::Ready(None),
            Poll::Pending => Pin::new(&mut responses).poll_next(context).map(Some),
        });
        let Some(response) = next.await else {
            connection.call_method(Some(PORTAL), &request, Some(REQUEST), "Close", &()).await?;
            return Ok(Reply::Cancelled);
        };
        let response = response.ok_or_else(|| Error::Failure("the bus is gone".to_owned()))??;
        if response.header().path().is_some_and(|path| *path == *request) {
            let (code, results) = response.body().deserialize()?;
            return reply_of(code, results, begin.elapsed());
        }
    }
}

/// Returns the answer that a response is, some time after the question.
fn reply_of(code: u32, mut results: HashMap<String, OwnedVariant>, after: Duration) -> zbus::Result<Reply> {
    match code {
        0 => {
            let uris = results.remove("uris").ok_or(Error::MissingField)?;
            let paths: Option<_> = Vec::<String>::try_from(uris)?.iter().map(|uri| path_of(uri)).collect();
            Ok(Reply::Chosen(paths.unwrap_or_default()))
        }
        1 => Ok(Reply::Cancelled),
        // Some desktops say so where Escape has closed the dialog, and all of them where none could be shown.
        _ if after >= AT_ONCE => Ok(Reply::Cancelled),
        _ => Err(Error::Failure(format!("response {code} at once"))),
    }
}

fn options(question: &Question) -> HashMap<&'static str, Variant<'_>> {
    let mut options = HashMap::from([("accept_label", Variant::from(question.button))]);
    if let Ok(folder) = std::path::absolute(&question.folder) {
        let text = [folder.as_os_str().as_bytes(), b"\0"].concat();
        options.insert("current_folder", text.into());
    }
    let of_folder = question.wanted == Wanted::Folder;
    match &question.wanted {
        Wanted::File => None,
        Wanted::Files => options.insert("multiple", true.into()),
        Wanted::Folder => options.insert("directory", true.into()),
        Wanted::New(name) => options.insert("current_name", name.as_str().into()),
    };
    if !of_folder {
        const GLOB: u32 = 0;
        let endings = question.endings;
        let name = if endings.len() > 5 { "All that vgs reads".to_owned() } else { endings.join(", ") };
        let globs: Vec<(u32, String)> = endings.iter().map(|ending| (GLOB, glob(ending))).collect();
        let all = ("All files".to_owned(), vec![(GLOB, "*".to_owned())]);
        options.insert("filters", vec![(name, globs), all].into());
    }
    options
}

/// Returns the pattern of names with an ending in capitals or not: dialogs tell them apart.
fn glob(ending: &str) -> String {
    let both = |c: char| {
        let capital = c.to_ascii_uppercase();
        if c == capital { c.to_string() } else { format!("[{c}{capital}]") }
    };
    format!("*{}", ending.chars().map(both).collect::<String>())
}

/// Returns the path that a URI names; `None` if it is none of this computer.
fn path_of(uri: &str) -> Option<PathBuf> {
    let rest = uri.strip_prefix("file://")?;
    let mut rest = rest.strip_prefix("localhost").unwrap_or(rest).bytes();
    let mut bytes = Vec::new();
    while let Some(byte) = rest.next() {
        let mut digit = || char::from(rest.next()?).to_digit(16);
        bytes.push(if byte == b'%' { (16 * digit()? + digit()?) as u8 } else { byte });
    }
    bytes.starts_with(b"/").then(|| OsString::from_vec(bytes).into())
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
