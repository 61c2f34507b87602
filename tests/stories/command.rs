//! Runs the command line as a user does, in a folder of its own.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// A folder, and the program run in it.
pub struct Bench {
    folder: TempDir,
}

/// What a run gave.
pub struct Ran {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Ran {
    fn of(o: &Output) -> Self {
        Self {
            code: o.status.code().unwrap_or(-1),
            stdout: String::from_utf8_lossy(&o.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&o.stderr).into_owned(),
        }
    }

    /// The one JSON object on stdout.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|e| panic!("stdout is no JSON object: {e}\n{}\n{}", self.stdout, self.stderr))
    }
}

impl Bench {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("temporary folder") }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), text).expect("written");
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn command(&self, words: &[&str]) -> Command {
        let mut c = Command::new(env!("CARGO_BIN_EXE_gonio_under_test"));
        c.args(words)
            .current_dir(self.folder.path())
            // scans of other tests are not this one's to stop
            .env("GONIO_RUNTIME_DIR", self.folder.path().join("run"))
            .stdin(Stdio::null());
        c
    }

    /// Runs to the end.
    pub fn run(&self, words: &[&str]) -> Ran {
        Ran::of(&self.command(words).output().expect("the program starts"))
    }

    /// Runs to the end and expects exit code 0.
    pub fn ok(&self, words: &[&str]) -> Ran {
        let ran = self.run(words);
        assert_eq!(ran.code, 0, "gonio {}\n{}\n{}", words.join(" "), ran.stdout, ran.stderr);
        ran
    }

    /// Runs beside the test.
    pub fn start(&self, words: &[&str]) -> Child {
        self.command(words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts")
    }
}

/// The end of a run beside the test.
pub fn end(child: Child) -> Ran {
    Ran::of(&child.wait_with_output().expect("the program ends"))
}

/// Polls until `done`, at most half a minute: waits for an event that another process makes.
pub fn until(what: &str, mut done: impl FnMut() -> bool) {
    let start = std::time::Instant::now();
    while !done() {
        assert!(start.elapsed().as_secs() < 30, "waited in vain for {what}");
        std::thread::yield_now();
    }
}

/// A paint for the virtual instrument.
pub const PAINT: &str = r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.3,0.12,0.06],"specular":[0.1,0.08,0.12],"exponent":60.0}"#;

/// Flips one bit of a file.
pub fn flip_bit(path: &Path, byte: usize) {
    let mut bytes = std::fs::read(path).expect("read");
    bytes[byte] ^= 4;
    std::fs::write(path, bytes).expect("written");
}
