//! What the file dialog of the desktop is asked, and its answer on the way, whichever program shows it.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

/// Shows the dialog of the desktop, and returns at once.
pub type SystemDialog = Box<dyn Fn(Question) -> Pending>;

/// What is asked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Question {
    /// Title of the dialog.
    pub title: &'static str,
    /// Name of the button that confirms.
    pub button: &'static str,
    /// What is to be chosen.
    pub wanted: Wanted,
    /// Endings of the files that are listed, in lower case and with their dots.
    pub endings: &'static [&'static str],
    /// Folder that is listed first.
    pub folder: PathBuf,
}

/// What is to be chosen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// A file that is there.
    File,
    /// One or several files that are there.
    Files,
    /// A folder that is there.
    Folder,
    /// A file that is written, for which this name is suggested.
    New(String),
}

/// Answer of the dialog.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// These were chosen. There are none if what was chosen is no file that programs can open by a path.
    Chosen(Vec<PathBuf>),
    /// The user has put the dialog away.
    Cancelled,
    /// There is no dialog of the desktop.
    Unavailable,
}

/// Answer that is on its way. The dialog is closed once this is dropped.
#[derive(Debug)]
pub struct Pending {
    reply: Receiver<Reply>,
    wanted: Arc<Mutex<WhetherWanted>>,
}

/// Thread that shows the dialog, and answers.
pub struct Replier {
    reply: Sender<Reply>,
    wanted: Arc<Mutex<WhetherWanted>>,
}

#[derive(Debug, Default)]
struct WhetherWanted {
    is_dropped: bool,
    /// What wakes the thread.
    waker: Option<Waker>,
}

impl Pending {
    /// Creates both ends of an answer.
    pub fn new() -> (Pending, Replier) {
        let (sender, receiver) = channel();
        let wanted = Arc::<Mutex<WhetherWanted>>::default();
        (Pending { reply: receiver, wanted: Arc::clone(&wanted) }, Replier { reply: sender, wanted })
    }

    /// Returns the answer once it is there.
    pub fn reply(&self) -> Option<Reply> {
        match self.reply.try_recv() {
            Ok(reply) => Some(reply),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Reply::Unavailable),
        }
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        let mut wanted = self.wanted.lock().unwrap_or_else(PoisonError::into_inner);
        wanted.is_dropped = true;
        wanted.waker.take().into_iter().for_each(Waker::wake);
    }
}

impl Replier {
    /// Answers.
    pub fn send(&self, reply: Reply) {
        // Nobody may want it any more.
        let _ = self.reply.send(reply);
    }

    /// Is ready once nobody wants the answer any more.
    pub fn poll_dropped(&self, context: &Context<'_>) -> Poll<()> {
        let mut wanted = self.wanted.lock().unwrap_or_else(PoisonError::into_inner);
        wanted.waker = Some(context.waker().clone());
        if wanted.is_dropped { Poll::Ready(()) } else { Poll::Pending }
    }
}
