//! A screen of its own for a program with a window, a hand on its mouse and keys, and an eye on what it shows.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use crate::support::{Ended, Folder, finish};

/// Longest that a test waits for a window to do something.
const PATIENCE: Duration = Duration::from_secs(120);

/// A virtual screen.
pub struct Screen {
    server: Child,
    display: String,
    file: PathBuf,
}

fn tool(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

impl Screen {
    /// A screen that has room for the viewer's window. Nothing, with a sentence, where there is no Xvfb.
    pub fn new() -> Option<Self> {
        Self::of_size("1280x800")
    }

    /// A screen of another size.
    pub fn of_size(size: &str) -> Option<Self> {
        let mut server = Command::new(tool("xvfb"))
            .env("VGS_SCREEN_SIZE", size)
            .args(["sh", "-c", "echo $DISPLAY $VGS_SCREEN; exec cat"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let mut line = String::new();
        BufReader::new(server.stdout.as_mut()?).read_line(&mut line).ok()?;
        let Some((display, file)) = line.trim().split_once(' ') else {
            println!("skipped: there is no virtual screen; `tools/setup window` brings one");
            assert!(std::env::var_os("CI").is_none(), "CI has a virtual screen");
            return None;
        };
        Some(Screen { display: display.to_owned(), file: file.into(), server })
    }

    /// Moves the mouse, presses keys: the arguments of xdotool.
    pub fn hand(&self, arguments: &[&str]) {
        let mut command = match std::env::var_os("VGS_RUNNER") {
            Some(runner) => {
                let mut command = Command::new(runner);
                command.arg("xdotool");
                command
            }
            None => Command::new("xdotool"),
        };
        let status = command.args(arguments).env("DISPLAY", &self.display).status().expect("xdotool starts");
        assert!(status.success(), "xdotool {arguments:?}");
    }

    /// What is shown: width, height, and red, green, blue of each pixel, rows from the top.
    pub fn look(&self) -> Shot {
        Shot::of(&fs::read(&self.file).expect("the screen's file"))
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // Its command ends with its input, and the screen with its command.
        drop(self.server.stdin.take());
        let _ = self.server.wait();
    }
}

/// A picture of the screen.
#[derive(Clone, PartialEq)]
pub struct Shot {
    pub size: [usize; 2],
    pub pixels: Vec<[u8; 3]>,
}

impl Shot {
    /// From a file of xwd: a header of big-endian words, colours, then rows of four bytes a pixel, blue first.
    fn of(xwd: &[u8]) -> Self {
        let word = |i: usize| u32::from_be_bytes(xwd[4 * i..4 * i + 4].try_into().expect("a word")) as usize;
        let [header, width, height, bits, stride, colours] = [0, 4, 5, 11, 12, 19].map(word);
        assert_eq!(bits, 32, "bits of a pixel");
        let start = header + 12 * colours;
        let pixels = (0..height).flat_map(|y| {
            let row = &xwd[start + y * stride..][..4 * width];
            row.as_chunks::<4>().0.iter().map(|&[b, g, r, _]| [r, g, b])
        });
        Shot { size: [width, height], pixels: pixels.collect() }
    }

    pub fn at(&self, x: usize, y: usize) -> [u8; 3] {
        self.pixels[y * self.size[0] + x]
    }

    /// Pixels within left, top, right, bottom that satisfy something.
    pub fn count(&self, [left, top, right, bottom]: [usize; 4], is: impl Fn([u8; 3]) -> bool) -> usize {
        (top..bottom).map(|y| (left..right).filter(|&x| is(self.at(x, y))).count()).sum()
    }

    /// Pixels within left, top, right, bottom that differ by more than noise.
    pub fn differences(&self, other: &Shot, area: [usize; 4]) -> usize {
        let [left, top, right, bottom] = area;
        let differ =
            |x: usize, y: usize| self.at(x, y).iter().zip(other.at(x, y)).any(|(a, b)| a.abs_diff(b) > 8);
        (top..bottom).map(|y| (left..right).filter(|&x| differ(x, y)).count()).sum()
    }

    /// Writes it beside the test's other results, to be looked at: a folder that `VGS_SHOTS` names.
    pub fn keep(&self, name: &str) {
        let Some(folder) = std::env::var_os("VGS_SHOTS") else { return };
        let pixels = self.pixels.iter().map(|p| {
            let [r, g, b] = p.map(|v| f32::from(v) / 255.0);
            [r, g, b, 1.0]
        });
        let image = engine::image::Image { size: self.size, pixels: pixels.collect() };
        let path = Path::new(&folder).join(format!("{name}.png"));
        engine::image::write(
            &path,
            &image,
            None,
            &engine::image::WriteOptions { force: true, ..Default::default() },
        )
        .expect("a picture");
    }
}

/// `vgs view` on a screen.
pub struct Viewer<'a> {
    screen: &'a Screen,
    child: Option<Child>,
    log: Arc<Mutex<String>>,
    /// The thread that reads what it says.
    reader: Option<JoinHandle<()>>,
}

impl<'a> Viewer<'a> {
    /// Starts it in a folder and waits for its first picture.
    pub fn start(screen: &'a Screen, folder: &Folder, arguments: &[&str]) -> Self {
        Self::start_with(screen, folder, arguments, &[])
    }

    /// The same with something of its environment changed.
    pub fn start_with(
        screen: &'a Screen,
        folder: &Folder,
        arguments: &[&str],
        environment: &[(&str, &str)],
    ) -> Self {
        let mut child = folder
            .command(&[&["view", "-vv"], arguments].concat())
            .env("DISPLAY", &screen.display)
            .env_remove("WAYLAND_DISPLAY")
            .env("XDG_CONFIG_HOME", folder.path("config"))
            // A dialog of the desktop would be none of this screen.
            .env("DBUS_SESSION_BUS_ADDRESS", "unix:path=/nowhere")
            .envs(environment.iter().copied())
            .spawn()
            .expect("the viewer starts");
        let log = Arc::new(Mutex::new(String::new()));
        let (lines, kept) = (BufReader::new(child.stderr.take().expect("stderr")).lines(), Arc::clone(&log));
        let reader = std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                let mut kept = kept.lock().expect("the log");
                kept.push_str(&line);
                kept.push('\n');
            }
        });
        Viewer { screen, child: Some(child), log, reader: Some(reader) }
    }

    /// What it has said.
    pub fn log(&self) -> String {
        self.log.lock().expect("the log").clone()
    }

    /// Frames that were shown, and those with a picture among them that was rendered in full.
    pub fn frames(&self) -> [usize; 2] {
        let log = self.log();
        ["frame shown", "picture rendered in full"].map(|what| log.matches(what).count())
    }

    /// Waits until something holds.
    pub fn wait(&mut self, what: &str, mut holds: impl FnMut(&Self) -> bool) {
        let begin = Instant::now();
        while !holds(self) {
            let ended = self.child.as_mut().and_then(|c| c.try_wait().ok().flatten());
            assert!(ended.is_none(), "the viewer ended before {what}:\n{}", self.log());
            assert!(begin.elapsed() < PATIENCE, "no {what} after {PATIENCE:?}:\n{}", self.log());
            sleep(Duration::from_millis(20));
        }
    }

    /// Waits until no frame has come for a while and none is being made, however slow the machine is.
    pub fn settle(&mut self) {
        let mut last = ((self.frames(), self.cpu_seconds()), Instant::now());
        self.wait("rest", |viewer| {
            let now = (viewer.frames(), viewer.cpu_seconds());
            if now != last.0 {
                last = (now, Instant::now());
            }
            last.1.elapsed() > Duration::from_millis(700)
        });
    }

    /// Drags with a button, so slowly that no two events fall into one frame: between two frames panels take a press and its
    /// release for a click.
    pub fn drag(&mut self, button: &str, from: [&str; 2], to: [&str; 2]) -> Shot {
        let before = self.frames()[1];
        let screen = self.screen;
        let [x, y] = from;
        for step in [
            &["mousemove", x, y][..],
            &["mousedown", button],
            &["mousemove", to[0], to[1]],
            &["mouseup", button],
        ] {
            screen.hand(step);
            self.settle();
        }
        self.wait(&format!("answer to a drag from {from:?} to {to:?}"), |viewer| viewer.frames()[1] > before);
        self.settle();
        screen.look()
    }

    /// Does something with mouse or keys, and waits until a picture in full has answered it.
    pub fn act(&mut self, arguments: &[&str]) -> Shot {
        let before = self.frames()[1];
        self.screen.hand(arguments);
        self.wait(&format!("answer to {arguments:?}"), |viewer| viewer.frames()[1] > before);
        self.settle();
        self.screen.look()
    }

    /// Asks by a key for a file to be written, names it, and waits until it is there.
    pub fn write(&mut self, folder: &Folder, key: &str, name: &str) {
        let path = folder.path(name).to_string_lossy().into_owned();
        for step in [&["key", key][..], &["key", "ctrl+a"], &["type", "--delay", "20", &path]] {
            self.screen.hand(step);
            self.settle();
        }
        self.screen.hand(&["key", "Return"]);
        self.wait(name, |_| folder.path(name).is_file());
        self.settle();
    }

    /// CPU time of the process so far, s (Linux, 100 ticks a second).
    pub fn cpu_seconds(&self) -> f64 {
        let id = self.child.as_ref().expect("it runs").id();
        let stat = fs::read_to_string(format!("/proc/{id}/stat")).expect("a process");
        let fields: Vec<&str> = stat.rsplit(')').next().expect("fields").split_whitespace().collect();
        let ticks: f64 = [11, 12].map(|i: usize| fields[i].parse::<f64>().expect("ticks")).iter().sum();
        ticks / 100.0
    }

    /// Ends it by its key, and gives how it ended.
    pub fn quit(mut self) -> Ended {
        self.screen.hand(&["key", "ctrl+q"]);
        self.wait_for_end()
    }

    /// Waits until it has ended by itself, and gives how.
    pub fn end(mut self) -> Ended {
        self.wait_for_end()
    }

    fn wait_for_end(&mut self) -> Ended {
        let begin = Instant::now();
        let mut child = self.child.take().expect("it runs");
        while child.try_wait().expect("a child").is_none() {
            if begin.elapsed() > PATIENCE {
                let _ = child.kill();
                panic!("the viewer does not end:\n{}", self.log());
            }
            sleep(Duration::from_millis(20));
        }
        let mut ended = finish(child);
        self.reader.take().expect("it runs").join().expect("text");
        ended.err = self.log();
        ended
    }
}

/// The notice has been read, so that it is not in the way.
pub fn without_notice(folder: &Folder) {
    fs::create_dir_all(folder.path("config/vgs")).expect("a folder");
    fs::write(folder.path("config/vgs/view.toml"), "notice_seen = true\n").expect("settings");
}

/// Starts the viewer, waits for its first picture in full, and gives it the keys.
pub fn begin<'a>(screen: &'a Screen, folder: &Folder, arguments: &[&str]) -> Viewer<'a> {
    let mut viewer = Viewer::start(screen, folder, arguments);
    viewer.wait("the first picture", |v| v.frames()[1] > 0);
    viewer.settle();
    // There is no window manager to give it the keys.
    screen.hand(&["search", "--name", "vgs", "windowfocus"]);
    screen.hand(&["mousemove", "450", "380"]);
    viewer.settle();
    viewer
}

impl Drop for Viewer<'_> {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
