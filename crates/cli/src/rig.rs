//! A stage and a camera, opened as the command line names them: real ones, or the virtual instrument behind the same serial code.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use gonio_driver::camera::{CameraFaults, FaultyCamera};
use gonio_driver::ports;
use gonio_driver::stage::{Direction, LinkWatch, Options, Reopen, SerialStage, StageEvent, describe_fault};
use gonio_driver::transport::{FaultyTransport, LineFaults, SerialTransport, Transport, serial};
use gonio_instrument::{
    Camera, Certificate, Description, DeviceError, Misalignment, Plan, ScanKind, Stage, builtin,
};
use gonio_sim::firmware::serve::pty::{PortName, Pty, serve_pty};
use gonio_sim::firmware::{Faults, Firmware, LinkFaults, Settings};
use gonio_sim::optics::Sample;
use gonio_sim::world::World;
use gonio_sim::{Truth, VirtualCamera};

use crate::arguments::VirtualArguments;
use crate::devices::{self, CameraChoice, StageName};
use crate::outcome::Failure;
use crate::output::read_text;

/// Events of the stage that wait for the journal.
const NOTES_DEPTH: usize = 1024;
/// Bytes on the wire that wait for the journal; a scan that falls behind loses log lines, never time.
const WIRE_DEPTH: usize = 65_536;

/// Something that happened to the stage's session.
pub struct StageNote {
    /// When, since the Unix epoch.
    pub time: Duration,
    /// Something went wrong.
    pub serious: bool,
    /// What happened.
    pub text: String,
}

/// Bytes that went over the wire.
pub struct WireRecord {
    /// Which way.
    pub direction: gonio_recording::Direction,
    /// When, since the Unix epoch.
    pub time: Duration,
    /// What.
    pub bytes: Vec<u8>,
}

/// The devices of a scan. Dropped, it leaves them safe.
pub struct Rig {
    /// The stage.
    pub stage: Box<dyn Stage>,
    /// The camera.
    pub camera: Box<dyn Camera>,
    /// Every byte on the wire.
    pub wire: Receiver<WireRecord>,
    /// What happens to the stage's session.
    pub notes: Receiver<StageNote>,
    /// How the link is doing, for those who watch.
    pub watch: LinkWatch,
    // dropped after the stage, which still says goodbye through it
    _virtual: Option<Pty>,
}

/// The virtual instrument as the command line describes it.
#[derive(Clone)]
pub struct Simulated {
    /// What the sample is.
    pub truth: Truth,
    /// Text of the truth, kept in the session.
    pub truth_text: Option<String>,
    /// Errors of the instrument.
    pub errors: Misalignment,
    /// Faults.
    pub faults: Faults,
    /// Seed of the noise.
    pub seed: u64,
    /// How much faster than life.
    pub time_scale: f64,
}

/// The paint on the holder where no truth is named: a blue of moderate gloss.
pub const DEMO_PAINT: &str = r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.06,0.13,0.32],"specular":[0.09,0.1,0.12],"exponent":120.0}"#;

impl Simulated {
    /// Reads the files that the arguments name.
    ///
    /// # Errors
    /// [`Failure::Usage`] naming the file and what is wrong in it.
    pub fn read(a: &VirtualArguments) -> Result<Self, Failure> {
        if !(a.time_scale > 0.0 && a.time_scale.is_finite()) {
            return Err(Failure::usage(format!("--time-scale {}: expected a positive number", a.time_scale)));
        }
        let in_file =
            |path: &Path, e: &dyn std::fmt::Display| Failure::usage(format!("{}: {e}", path.display()));
        let (truth, truth_text) = match &a.truth {
            Some(path) => (
                Truth::open(path).map_err(|e| in_file(path, &e))?,
                std::fs::read_to_string(path).ok().filter(|t| t.len() < 1 << 20),
            ),
            None => (
                Truth::from_bytes(DEMO_PAINT.as_bytes()).map_err(Failure::usage)?,
                Some(DEMO_PAINT.to_owned()),
            ),
        };
        let errors = match &a.misalignment {
            None => Misalignment::default(),
            Some(path) if path.as_os_str() == "builtin" => builtin::misalignment().map_err(Failure::usage)?,
            Some(path) => Misalignment::from_toml(&read_text(path)?).map_err(|e| in_file(path, &e))?,
        };
        let faults = match &a.faults {
            None => Faults::default(),
            Some(path) => Faults::from_toml(&read_text(path)?).map_err(|e| in_file(path, &e))?,
        };
        Ok(Self { truth, truth_text, errors, faults, seed: a.seed, time_scale: a.time_scale })
    }

    /// What shall go wrong with the session file.
    #[must_use]
    pub fn file_faults(&self) -> Option<gonio_recording::FileFaults> {
        self.faults.file.map(|f| gonio_recording::FileFaults {
            full_after: f.full_after,
            fail_after: f.fail_after,
            fail: f.fail,
            slow: Duration::from_millis(u64::from(f.slow_ms)),
            seed: self.seed,
        })
    }

    fn firmware(&self, instrument: &Description, plan: &Plan, world: &World) -> Firmware {
        let settings = Settings::new(instrument, self.seed, self.time_scale)
            .with_plan(plan)
            .with_misalignment(&self.errors);
        Firmware::new(settings, world.clone(), self.faults.clone())
    }

    fn camera(
        &self,
        instrument: &Description,
        kind: ScanKind,
        world: &World,
    ) -> Result<VirtualCamera, Failure> {
        let sample =
            Sample::of_kind(kind, &self.truth, &Certificate::virtual_white()).map_err(Failure::usage)?;
        Ok(VirtualCamera::new(world.clone(), instrument, &self.errors, sample, self.seed))
    }

    /// The virtual instrument as a pseudo-terminal (at `link`, if given) and a camera.
    ///
    /// # Errors
    /// [`Failure::Failed`] where the system gives no pseudo-terminal.
    pub fn start(
        &self,
        instrument: &Description,
        plan: &Plan,
        kind: ScanKind,
        link: Option<&Path>,
    ) -> Result<(Pty, VirtualCamera), Failure> {
        let world = World::new(self.time_scale);
        let pty = serve_pty(self.firmware(instrument, plan, &world), link)
            .map_err(|e| Failure::failed("the virtual stage cannot be started", e))?;
        Ok((pty, self.camera(instrument, kind, &world)?))
    }
}

impl Rig {
    /// Opens stage and camera.
    ///
    /// # Errors
    /// [`Failure::Usage`] for a device of no known kind, [`Failure::Device`] for one that cannot be opened.
    pub fn open(
        device: &str,
        camera: &str,
        instrument: &Description,
        plan: &Plan,
        kind: ScanKind,
        simulated: Option<&Simulated>,
        patience: Duration,
    ) -> Result<Self, Failure> {
        let (sender, wire) = sync_channel(WIRE_DEPTH);
        let (told, notes) = sync_channel(NOTES_DEPTH);
        let (stage_name, choice) = (StageName::parse(device)?, CameraChoice::parse(camera)?);
        // what cannot be is said before any device is touched
        devices::check(&stage_name, &choice)?;
        let line = simulated.and_then(|s| s.faults.link.map(|l| (l, s.seed)));
        let (opened, reopen, pty, virtual_camera) = match (stage_name, simulated) {
            (StageName::Sim, Some(s)) => {
                let (pty, camera) = s.start(instrument, plan, kind, None)?;
                let path = pty.path.to_string_lossy().into_owned();
                let again = reopen(Some(pty.name()), path.clone(), line);
                (transport(&path, line)?, again, Some(pty), Some(camera))
            }
            (StageName::Sim, None) => {
                return Err(Failure::usage("--device sim needs what it shall simulate"));
            }
            (StageName::Serial(path), _) => (transport(&path, line)?, reopen(None, path, line), None, None),
            (StageName::Usb(address), _) => {
                let (stage, again) = devices::usb(&address)?;
                (stage, again, None, None)
            }
        };
        let camera: Box<dyn Camera> = match (&choice, virtual_camera) {
            (CameraChoice::Sim, Some(c)) => Box::new(c),
            (choice, _) => devices::camera(choice, instrument, patience, &told)?,
        };
        let options = Options {
            tap: Some(tap(sender)),
            events: Some(teller(told)),
            reopen: Some(reopen),
            patience,
            ..Options::default()
        };
        let stage = Box::new(SerialStage::connect(opened, options)?);
        let camera = match simulated.and_then(|s| s.faults.camera.map(|c| (c, s.seed))) {
            Some((faults, seed)) => Box::new(FaultyCamera::new(camera, camera_faults(&faults), seed)),
            None => camera,
        };
        let watch = stage.client().watch();
        Ok(Self { stage, camera, wire, notes, watch, _virtual: pty })
    }
}

/// The serial port at `path`, behind a bad line where the faults file of the virtual instrument asks for one.
fn transport(path: &str, line: Option<(LinkFaults, u64)>) -> Result<Box<dyn Transport>, DeviceError> {
    let port = SerialTransport::open(path, serial::DEFAULT_BAUD)?;
    let Some((l, seed)) = line else { return Ok(Box::new(port)) };
    let faults = LineFaults {
        loss: l.loss,
        corruption: l.corruption,
        duplication: l.duplication,
        reorder: l.reorder,
        delay: Duration::from_millis(u64::from(l.delay_ms)),
        hang_up_after: l.hang_up_after,
        stall: l.stall_after.map(|n| (n, Duration::from_millis(u64::from(l.stall_ms)))),
        half_open: l.half_open_after.map(|n| (n, Duration::from_millis(u64::from(l.half_open_ms)))),
    };
    Ok(Box::new(FaultyTransport::new(port, faults, seed)))
}

/// Finds the port again after it hung up: under its name, by the USB adapter behind it, or where the virtual instrument has it now. A line that hangs up by the faults file
/// comes back when that says so, or never; its other troubles are over then.
fn reopen(name: Option<PortName>, path: String, line: Option<(LinkFaults, u64)>) -> Reopen {
    let hung_up = std::sync::Mutex::new(None::<Instant>);
    // a USB adapter may have another name when it is plugged in again
    let adapter = if name.is_none() { ports::Adapter::at(Path::new(&path)) } else { None };
    Arc::new(move || {
        let mut hung_up = hung_up.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let since = *hung_up.get_or_insert_with(Instant::now);
        let away = match line {
            Some((LinkFaults { hang_up_after: Some(_), hang_up_ms: None, .. }, _)) => true,
            Some((LinkFaults { hang_up_ms: Some(ms), .. }, _)) => {
                since.elapsed() < Duration::from_millis(u64::from(ms))
            }
            _ => false,
        };
        let now = match &name {
            Some(name) => name.path().map(|p| p.to_string_lossy().into_owned()),
            None => match &adapter {
                Some(adapter) => adapter.path(Path::new(&path)),
                None => Some(path.clone()),
            },
        };
        let Some(now) = now.filter(|_| !away) else {
            return Err(DeviceError::Absent { device: path.clone() });
        };
        let line =
            line.map(|(l, seed)| (LinkFaults { stall_after: None, half_open_after: None, ..l }, seed + 1));
        let opened = transport(&now, line)?;
        *hung_up = None;
        Ok(opened)
    })
}

fn camera_faults(c: &gonio_sim::CameraFaults) -> CameraFaults {
    CameraFaults {
        dropped: c.dropped,
        torn: c.torn,
        frozen: c.frozen,
        duplicated: c.duplicated,
        late: c.late,
        late_by: Duration::try_from_secs_f64(c.late_by_ms * 1e-3).unwrap_or_default(),
        unplugged_after: c.unplugged_after,
    }
}

/// What happens to the session, in words, to the journal's end of a channel; never waits.
fn teller(sender: SyncSender<StageNote>) -> gonio_driver::stage::EventSink {
    Arc::new(move |event: &StageEvent| {
        let (serious, text) = match event {
            StageEvent::Connected(identity) => (
                false,
                format!("session with {} begun, start number {}", identity.serial, identity.boot_counter),
            ),
            StageEvent::Fault { fault, uptime } => (
                true,
                format!(
                    "the stage reports {} at {:.3} s of its time",
                    describe_fault(*fault),
                    uptime.as_secs_f64()
                ),
            ),
            StageEvent::Restarted { boot } => {
                (true, format!("the stage has restarted (start number {boot})"))
            }
            StageEvent::EmergencyStopped { .. } => {
                (true, "the stage has obeyed an emergency stop".to_owned())
            }
            StageEvent::Silent { waited } => (true, format!("the stage has been silent for {waited:.1?}")),
            StageEvent::HungUp(error) => (true, format!("the line hung up: {error}")),
            StageEvent::Returned { away, position } => (
                false,
                format!(
                    "the line is back after {away:.3?}, the stage stands at tilt {:.3}°, spin {:.3}°",
                    f64::from(position.tilt_udeg) / 1e6,
                    f64::from(position.spin_udeg) / 1e6
                ),
            ),
            StageEvent::Shifted { why } => (true, format!("positions are void: the stage {why}")),
            StageEvent::Gone(error) => (true, format!("the stage is given up: {error}")),
        };
        let time = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let _ = sender.try_send(StageNote { time, serious, text });
    })
}

/// Sends every byte to the journal's end of a channel, never waiting.
fn tap(sender: SyncSender<WireRecord>) -> gonio_driver::stage::Tap {
    Arc::new(move |direction: Direction, at: Instant, bytes: &[u8]| {
        let ago = at.elapsed();
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let direction = match direction {
            Direction::ToDevice => gonio_recording::Direction::ToDevice,
            Direction::FromDevice => gonio_recording::Direction::FromDevice,
        };
        let _ =
            sender.try_send(WireRecord { direction, time: now.saturating_sub(ago), bytes: bytes.to_vec() });
    })
}

/// An instrument by name (`reference`, `tiny`) or from a TOML file.
///
/// # Errors
/// [`Failure::Usage`] with the file's fault.
pub fn instrument(name: &str) -> Result<Description, Failure> {
    match builtin::description(name) {
        Some(d) => d.map_err(Failure::usage),
        None if !Path::new(name).exists() => Err(Failure::usage(format!(
            "--instrument {name}: expected `reference`, `tiny` or a TOML file; no such file is there"
        ))),
        None => Description::from_toml(&read_text(Path::new(name))?)
            .map_err(|e| Failure::usage(format!("{name}: {e}"))),
    }
}

/// A plan from a file, or the instrument's own; checked against the holder's limits.
///
/// # Errors
/// [`Failure::Usage`] naming the pose and the limits.
pub fn plan(path: Option<&Path>, instrument: &Description) -> Result<Plan, Failure> {
    let Some(path) = path else { return Ok(instrument.plan.clone()) };
    let in_file = |e: gonio_instrument::FileError| Failure::usage(format!("{}: {e}", path.display()));
    let plan = Plan::from_toml(&read_text(path)?).map_err(in_file)?;
    plan.check(instrument).map_err(in_file)?;
    Ok(plan)
}
