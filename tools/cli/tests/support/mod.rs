//! Runs the real program on files in a folder of its own.

pub mod screen;
pub mod series;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use serde_json::Value;

/// The program, through the runner that brings the Vulkan driver where there is one.
pub fn vgs() -> Command {
    let program = env!("CARGO_BIN_EXE_vgs");
    let mut command = match std::env::var_os("VGS_RUNNER") {
        Some(runner) => {
            let mut command = Command::new(runner);
            command.arg(program);
            command
        }
        None => Command::new(program),
    };
    for variable in
        ["VGS_DEVICE", "VGS_CONFIG", "VGS_PROFILE", "VGS_QUALITY", "VGS_MAX_BYTES", "VGS_ITERATIONS"]
    {
        command.env_remove(variable);
    }
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// A temporary folder with a small phantom, `ct.nii.gz` and `mask.nii.gz`.
pub struct Folder(tempfile::TempDir);

/// How a run ended.
pub struct Ended {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Ended {
    fn of(output: Output) -> Self {
        Ended {
            code: output.status.code().unwrap_or(-1),
            out: String::from_utf8_lossy(&output.stdout).into_owned(),
            err: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }

    /// The JSON object on stdout, of a run that must have succeeded.
    pub fn json(&self) -> Value {
        assert_eq!(self.code, 0, "{}{}", self.out, self.err);
        serde_json::from_str(&self.out).unwrap_or_else(|e| panic!("{e}: {}", self.out))
    }
}

impl Folder {
    /// With a phantom of `size` cubed.
    pub fn new(size: u32) -> Self {
        Self::with_seed(size, 1)
    }

    /// With the phantom of a seed.
    pub fn with_seed(size: u32, seed: u32) -> Self {
        let folder = Folder(tempfile::tempdir().expect("a temporary folder"));
        let ended =
            folder.run(&["phantom", "-o", ".", "--size", &size.to_string(), "--seed", &seed.to_string()]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        folder
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("writing a test file");
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).expect("text")
    }

    /// A command in the folder.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = vgs();
        command.args(arguments).current_dir(self.0.path());
        command
    }

    pub fn run(&self, arguments: &[&str]) -> Ended {
        Ended::of(self.command(arguments).output().expect("the program starts"))
    }

    pub fn start(&self, arguments: &[&str]) -> Child {
        self.command(arguments).spawn().expect("the program starts")
    }

    /// Every file with its content: what must not change when a command refuses.
    pub fn contents(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        files(self.0.path())
    }
}

fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        match path.is_dir() {
            true => all.extend(files(&path)),
            false => {
                all.insert(path.clone(), fs::read(&path).expect("a file"));
            }
        }
    }
    all
}

/// Waits for a child.
pub fn finish(child: Child) -> Ended {
    Ended::of(child.wait_with_output().expect("the program ends"))
}

/// The flags of a fit that takes a moment; an output and a region go with them.
pub const QUICK: [&str; 8] =
    ["--iterations", "24", "--splats", "60", "--offsets", "4", "--eval-offsets", "2"];

/// `fit ct.nii.gz --roi mask.nii.gz` with more flags.
pub fn fit<'a>(output: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let mut all = vec!["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", output];
    all.extend(QUICK.iter().filter(|_| !more.contains(&"--iterations")));
    all.extend(more);
    all
}
