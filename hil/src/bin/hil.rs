//! `make test-hil`: boots the machine, plugs the virtual devices in, runs the tests there and says whether all passed.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use gonio_hil::files;
use gonio_hil::guest::TESTS;
use gonio_hil::host::{Bench, Ended, Files, Machine, Verdict, evaluation};
use gonio_hil::line::{Device, Figure};
use gonio_instrument::certificate::Certificate;
use gonio_instrument::{Description, builtin};
use gonio_sim::Truth;

/// The paint on the holder: a blue of moderate gloss.
const PAINT: &[u8] = br#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.06,0.13,0.32],"specular":[0.09,0.1,0.12],"exponent":120.0}"#;
const SEED: u64 = 1;
/// Shortest and longest exposure.
const EXPOSURE_S: [f64; 2] = [1e-4, 0.1];
/// How often a machine is booted anew whose own kernel fell over.
const AGAIN: u32 = 1;
/// Longest a run may take besides the watch over frames.
const LONGEST: Duration = Duration::from_secs(400);

/// Runs gonio's driver against the drivers of a real kernel, on virtual hardware.
#[derive(Parser)]
struct Arguments {
    /// Folder that `scripts/hil set-up` filled.
    #[arg(long, default_value = "target/hil")]
    files: PathBuf,
    /// Folder of the programs hil-guest and gonio.
    #[arg(long, default_value = "target/debug")]
    programs: PathBuf,
    /// Leave a device out: serial, usb or camera. The run must fail then.
    #[arg(long, value_parser = device)]
    without: Vec<Device>,
    /// Run only the tests whose name holds this.
    #[arg(long)]
    only: Option<String>,
    /// How long frames are watched for losses, s.
    #[arg(long, default_value_t = 10)]
    watch_s: u64,
    /// Keep the sessions of the scans in this folder.
    #[arg(long)]
    keep: Option<PathBuf>,
    /// Runs, one after the other; ends with the first that fails.
    #[arg(long, default_value_t = 1)]
    runs: u32,
}

fn device(name: &str) -> Result<Device, String> {
    Device::ALL
        .into_iter()
        .find(|d| d.name() == name)
        .ok_or_else(|| format!("{name} is none of serial, usb, camera"))
}

fn main() -> ExitCode {
    let a = Arguments::parse();
    for n in 1..=a.runs {
        let start = Instant::now();
        let faults = run_again(&a);
        let seconds = start.elapsed().as_secs_f64();
        for fault in &faults {
            gonio_hil::log(fault);
        }
        if !faults.is_empty() {
            gonio_hil::log(&format!("FAILED: run {n} of {}, {seconds:.0} s", a.runs));
            return ExitCode::FAILURE;
        }
        gonio_hil::log(&format!("all well: run {n} of {}, {seconds:.0} s", a.runs));
    }
    ExitCode::SUCCESS
}

type Error = Box<dyn std::error::Error>;

/// What is wrong with a run; nothing if it is good.
#[derive(Default)]
struct Faults {
    list: Vec<String>,
    /// What the guest's kernel said when it fell over.
    kernel: Option<String>,
}

impl From<Vec<String>> for Faults {
    fn from(list: Vec<String>) -> Self {
        Self { list, kernel: None }
    }
}

/// A run, once more where not the driver failed but the kernel under it.
fn run_again(a: &Arguments) -> Vec<String> {
    for left in (0..=AGAIN).rev() {
        let faults = run(a).unwrap_or_else(|error| vec![error.to_string()].into());
        match faults.kernel {
            Some(said) if left > 0 => {
                gonio_hil::log(&format!(
                    "the guest's own kernel fell over ({said}); run again, at most {left} more"
                ));
            }
            _ => return faults.list,
        }
    }
    Vec::new()
}

fn run(a: &Arguments) -> Result<Faults, Error> {
    let tests: Vec<&str> = TESTS
        .iter()
        .map(|(name, _)| *name)
        .filter(|n| a.only.as_ref().is_none_or(|only| n.contains(only.as_str())))
        .collect();
    if tests.is_empty() {
        return Ok(vec!["no test has such a name".to_owned()].into());
    }
    // the first waits until the kernel has found the devices, which the others rely on
    let first = TESTS.first().map(|(name, _)| *name).filter(|name| !tests.contains(name));
    let tests: Vec<&str> = first.into_iter().chain(tests).collect();
    let folder = tempfile::Builder::new().prefix("gonio-hil-").tempdir()?;
    let programs = std::fs::canonicalize(&a.programs)?;
    let files = Files { kernel: a.files.join("vmlinuz"), initrd: a.files.join("initrd") };
    let instrument = instrument()?;
    std::fs::write(folder.path().join(files::INSTRUMENT), instrument.to_toml()?)?;
    let certificate = serde_json::to_string(&Certificate::virtual_white())?;
    std::fs::write(folder.path().join(files::CERTIFICATE), certificate)?;
    let mut machine = Machine::boot(&files, folder.path(), &job(&programs, a.watch_s, &tests))?;
    let truth = Truth::from_bytes(PAINT)?;
    let mut verdict = Verdict::new(&tests);
    let bench = Bench::build(&instrument, truth, SEED, machine.sockets(), &a.without);
    let longest = LONGEST + Duration::from_secs(a.watch_s);
    let ended = match bench {
        Ok(mut bench) => {
            bench.serve(&mut verdict, longest)?;
            machine.wait(longest)
        }
        Err(error) => Ended::Silent(error.to_string()),
    };
    if evaluation::NEEDS.iter().all(|needed| tests.contains(needed)) {
        verdict.want(evaluation::NAME);
        evaluate(&programs.join("gonio"), folder.path(), &mut verdict);
    }
    if let Some(kept) = &a.keep {
        keep(folder.path(), kept)?;
    }
    std::io::stdout().write_all(verdict.table().as_bytes())?;
    let mut list = verdict.faults(&ended);
    let kernel = machine.kernel_fault().filter(|_| !list.is_empty());
    if !list.is_empty() {
        list.push(format!("the guest's console ended with\n{}", machine.console_tail()));
    }
    Ok(Faults { list, kernel })
}

/// Evaluates the scans of the guest here, where it is faster.
fn evaluate(gonio: &Path, folder: &Path, verdict: &mut Verdict) {
    let start = Instant::now();
    let found = evaluation::evaluate(gonio, folder, PAINT);
    let seconds = start.elapsed().as_secs_f64();
    if let Ok(off) = &found {
        verdict.figure(Figure {
            name: "paint found, largest difference of a parameter".to_owned(),
            value: 100.0 * off,
            unit: "%".to_owned(),
            bound: None,
            from: "fit of the scan through USB and the camera".to_owned(),
        });
    }
    verdict.result(evaluation::NAME.to_owned(), seconds, found.err());
}

/// The tiny instrument before a camera of the video class: exposures in its unit, and none so long that the tests wait for them.
fn instrument() -> Result<Description, Error> {
    let mut tiny = builtin::description("tiny").ok_or("no tiny instrument")??;
    tiny.name = "hil".to_owned();
    tiny.camera.exposure_s = EXPOSURE_S;
    Ok(tiny)
}

/// Copies sessions.
fn keep(from: &Path, to: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(to)?;
    for entry in std::fs::read_dir(from)? {
        let path = entry?.path();
        if let (Some(name), Some("mcap")) = (path.file_name(), path.extension().and_then(|e| e.to_str())) {
            std::fs::copy(&path, to.join(name))?;
        }
    }
    Ok(())
}

/// What the guest runs.
fn job(programs: &Path, watch_s: u64, tests: &[&str]) -> String {
    let programs = programs.display();
    format!(
        "export RUST_BACKTRACE=1 HOME=/root PATH=/usr/bin:/bin\nip link set lo up 2>/dev/null\n\
         exec '{programs}/hil-guest' --gonio '{programs}/gonio' --folder /gonio-job --watch-s {watch_s} {}\n",
        tests.join(" ")
    )
}
