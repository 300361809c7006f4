//! Tests of the dialog of the desktop: what comes of its answers.

use std::cell::RefCell;
use std::rc::Rc;

use super::*;
use crate::model::system_dialog::{Pending, Question, Replier, Reply, Wanted};

/// Dialogs that were asked for, and the ends that answer them.
type Shown = Rc<RefCell<Vec<(Question, Replier)>>>;

fn with_dialogs() -> (Bench, Shown) {
    let mut bench = Bench::new();
    let shown = Shown::default();
    let asked = Rc::clone(&shown);
    bench.app.system_dialog = Some(Box::new(move |question| {
        let (pending, replier) = Pending::new();
        asked.borrow_mut().push((question, replier));
        pending
    }));
    (bench, shown)
}

fn is_closed(replier: &Replier) -> bool {
    let context = std::task::Context::from_waker(std::task::Waker::noop());
    replier.poll_dropped(&context).is_ready()
}

#[test]
fn a_dialog_of_the_desktop_leads_to_what_it_was_asked_for() {
    let (mut bench, shown) = with_dialogs();
    let answer = |bench: &mut Bench, reply: Reply| {
        let (question, replier) = shown.borrow_mut().pop().expect("a dialog");
        assert!(bench.app.prompt.is_none() && !is_closed(&replier), "{question:?}");
        replier.send(reply);
        (question.wanted, bench.frame(Vec::new(), Modifiers::NONE))
    };
    let paths = vec![PathBuf::from("/a.ply"), "/b.ply".into()];
    assert_eq!(bench.press(Key::O, Modifiers::COMMAND), []);
    let opened = answer(&mut bench, Reply::Chosen(paths.clone()));
    assert_eq!(opened, (Wanted::Files, vec![Action::Open(paths)]));
    bench.press(Key::O, Modifiers::COMMAND | Modifiers::SHIFT);
    let opened = answer(&mut bench, Reply::Chosen(vec!["/scan".into()]));
    assert_eq!(opened, (Wanted::Folder, vec![Action::Open(vec!["/scan".into()])]));
    bench.press(Key::O, Modifiers::COMMAND);
    assert_eq!(answer(&mut bench, Reply::Cancelled), (Wanted::Files, vec![]));
    bench.press(Key::O, Modifiers::COMMAND);
    assert_eq!(answer(&mut bench, Reply::Chosen(vec![])).1, []);
    bench.rest();
    bench.find("The chosen file is not in a local folder");
    assert!(bench.app.prompt.is_none() && bench.app.asked.is_none());
    // What has options of its own is asked by our own dialog.
    bench.press(Key::P, Modifiers::COMMAND);
    bench.find("Screenshot");
    assert!(shown.borrow().is_empty());
}

#[test]
fn one_dialog_is_open_at_a_time_and_escape_closes_it() {
    let (mut bench, shown) = with_dialogs();
    bench.press(Key::O, Modifiers::COMMAND);
    bench.press(Key::T, Modifiers::COMMAND);
    assert_eq!(shown.borrow().len(), 1);
    bench.find("A file dialog is already open");
    // The window goes on meanwhile.
    let before = bench.app.state.orbit;
    bench.press(Key::L, Modifiers::NONE);
    assert!(bench.app.state.orbit != before);
    bench.press(Key::Escape, Modifiers::NONE);
    let (_, replier) = shown.borrow_mut().pop().expect("a dialog");
    assert!(is_closed(&replier));
    bench.press(Key::T, Modifiers::COMMAND);
    assert_eq!(shown.borrow().len(), 1);
    // The question whether to leave takes its place, and has a dialog of its own.
    bench.app.state.transfer.shift = 5.0;
    bench.press(Key::Q, Modifiers::COMMAND);
    let save = bench.find("Save session");
    bench.click(save);
    let dialogs = shown.borrow();
    let (first, second) = (&dialogs[0], &dialogs[1]);
    assert!(is_closed(&first.1) && !is_closed(&second.1));
    assert_eq!(second.0.title, "Save the session");
}

#[test]
fn our_own_dialog_stands_in_for_one_that_is_not_there() {
    let (mut bench, shown) = with_dialogs();
    bench.press(Key::O, Modifiers::COMMAND);
    let (_, replier) = shown.borrow_mut().pop().expect("a dialog");
    replier.send(Reply::Unavailable);
    bench.rest();
    bench.find("Open splats, a volume, a mask or a session");
    bench.press(Key::Escape, Modifiers::NONE);
    // It is not looked for again.
    bench.press(Key::O, Modifiers::COMMAND | Modifiers::SHIFT);
    bench.find("Open a folder of DICOM slices");
    assert!(shown.borrow().is_empty());
    bench.press(Key::Escape, Modifiers::NONE);
    // So it does for one whose thread has ended without a word.
    let (mut bench, shown) = with_dialogs();
    bench.press(Key::O, Modifiers::COMMAND);
    shown.borrow_mut().clear();
    bench.rest();
    assert!(bench.app.prompt.is_some() && bench.app.system_dialog.is_none());
}

#[test]
fn a_file_is_replaced_only_if_somebody_was_asked() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bench, shown) = with_dialogs();
    bench.app.state.files.splats = vec![folder.path().join("a.ply")];
    let path = folder.path().join("a.toml");
    let save = |bench: &mut Bench, name: &str| {
        bench.press(Key::S, Modifiers::COMMAND);
        let (question, replier) = shown.borrow_mut().pop().expect("a dialog");
        replier.send(Reply::Chosen(vec![folder.path().join(name)]));
        bench.rest();
        (question.wanted, question.folder)
    };
    let asked = save(&mut bench, "a.toml");
    assert_eq!(asked, (Wanted::New("a.toml".into()), folder.path().to_owned()));
    assert_eq!(ViewState::read(&path).expect("a session"), bench.app.state);
    bench.app.state.transfer.shift = 5.0;
    save(&mut bench, "a");
    bench.find("the file exists");
    assert_eq!(ViewState::read(&path).expect("a session").transfer.shift, 0.0);
    bench.press(Key::Escape, Modifiers::NONE);
    save(&mut bench, "a.toml");
    assert_eq!(ViewState::read(&path).expect("a session").transfer.shift, 5.0);
}
