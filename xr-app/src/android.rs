//! The program as an activity of a standalone headset: it shows the splats that are in its storage, and
//! writes its messages to the log.
#![allow(unsafe_code, reason = "the system calls the entry of the program by its name")]

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use android_activity::{AndroidApp, MainEvent, PollEvent};
use engine::{Error, Kind, Result};

use crate::arguments::HeadsetArguments;
use crate::headset::openxr;
use crate::program::{prepare, session};

// SAFETY: the glue of the activity calls the one function of this name and type; nothing else here is named
// so.
#[unsafe(no_mangle)]
fn android_main(app: AndroidApp) {
    openxr::set_activity(&app);
    show(&app);
}

/// Runs a session as long as the activity lasts. The session has a thread of its own, because this one has to
/// answer the system.
fn show(app: &AndroidApp) {
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let session = scope.spawn(|| {
            if let Err(e) = run(app, &stop) {
                eprintln!("error[{}]: {e}\n  help: {}", e.code, e.help);
            }
        });
        while !session.is_finished() {
            app.poll_events(Some(Duration::from_millis(50)), |event| {
                if let PollEvent::Main(MainEvent::Destroy) = event {
                    stop.store(true, Ordering::Relaxed);
                }
            });
        }
    });
}

/// Shows the splats of the folder that a cable reaches (Android/data/PACKAGE/files).
fn run(app: &AndroidApp, stop: &AtomicBool) -> Result<()> {
    let folder = app.external_data_path().ok_or_else(|| {
        Error::new(Kind::Unavailable, "VGS-XR-027", "the system gives the program no storage")
    })?;
    let arguments = HeadsetArguments::of_folder(&folder)?;
    session(&arguments, prepare(&arguments)?, None, stop, |_, _| Ok(None))
}
