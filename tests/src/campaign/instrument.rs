//! The tiny virtual instrument inside this process: a stage behind a pseudo-terminal and the production driver, a camera, and what faults there
//! shall be; and a scan with it, recorded as the command line does.

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use gonio_acquisition::PixelMap;
use gonio_acquisition::engine::{LostPose, Note, Outcome, Progress, Setup};
use gonio_acquisition::runner::{self, FrameCounts, Observer};
use gonio_driver::camera::{CameraFaults, CameraTally, FaultyCamera};
use gonio_driver::stage::{Options, SerialStage, StageEvent};
use gonio_driver::transport::{FaultyTransport, LineFaults, SerialTransport, Transport, serial};
use gonio_instrument::{
    Camera as _, Cancel, Description, DeviceError, Misalignment, Plan, SampleRecord, ScanKind, Stage as _,
    builtin,
};
use gonio_recording::{Devices, Header, Writer, WriterOptions};
use gonio_sim::VirtualCamera;
use gonio_sim::firmware::serve::{PortName, Pty, serve_pty};
use gonio_sim::firmware::{Faults, Firmware, Settings};
use gonio_sim::optics::Sample;
use gonio_sim::world::World;

/// Events of the stage with their times.
pub type Events = Arc<Mutex<Vec<(Instant, StageEvent)>>>;

/// The instrument, its camera not yet taken.
pub struct Tiny {
    /// The description.
    pub description: Description,
    /// The plan the firmware knows.
    pub plan: Plan,
    /// What is physically the case.
    pub world: World,
    /// The port.
    pub pty: Pty,
}

impl Tiny {
    /// A tiny instrument with `plan` (its own if none is given), `time_scale` times faster than life.
    ///
    /// # Panics
    /// Where the system gives no pseudo-terminal.
    #[must_use]
    pub fn new(plan: Option<Plan>, time_scale: f64, faults: Faults) -> Self {
        let description = builtin::description("tiny").expect("built in").expect("readable");
        let plan = plan.unwrap_or_else(|| description.plan.clone());
        let world = World::new(time_scale);
        let settings = Settings::new(&description, 1, time_scale).with_plan(&plan);
        let pty = serve_pty(Firmware::new(settings, world.clone(), faults), None).expect("a pseudo-terminal");
        Self { description, plan, world, pty }
    }

    /// The production driver on the port, which finds it again after a hang-up.
    ///
    /// # Errors
    /// As [`SerialStage::connect`].
    pub fn stage(
        &self,
        line: Option<(LineFaults, u64)>,
        events: Option<&Events>,
    ) -> Result<SerialStage, DeviceError> {
        let name = self.pty.name();
        let open = move |name: &PortName| -> Result<Box<dyn Transport>, DeviceError> {
            let absent = || DeviceError::Absent { device: "the port".to_owned() };
            let path = name.path().ok_or_else(absent)?;
            let port = SerialTransport::open(&path.to_string_lossy(), serial::DEFAULT_BAUD)?;
            Ok(match line {
                Some((faults, seed)) => Box::new(FaultyTransport::new(port, faults, seed)),
                None => Box::new(port),
            })
        };
        let first = open(&name)?;
        let sink = events.map(Arc::clone);
        let options = Options {
            reopen: Some(Arc::new(move || open(&name))),
            events: sink.map(|sink| {
                let told: gonio_driver::stage::EventSink = Arc::new(move |event: &StageEvent| {
                    if let Ok(mut events) = sink.lock() {
                        events.push((Instant::now(), event.clone()));
                    }
                });
                told
            }),
            ..Options::default()
        };
        SerialStage::connect(first, options)
    }

    /// The camera, which sees a matt white; counts what was done to its frames.
    #[must_use]
    pub fn camera(&self, faults: CameraFaults, seed: u64) -> (FaultyCamera<VirtualCamera>, CameraTally) {
        let sample = Sample::diffuser(0.5);
        let camera =
            VirtualCamera::new(self.world.clone(), &self.description, &Misalignment::default(), sample, seed);
        let camera = FaultyCamera::new(camera, faults, seed);
        let tally = camera.tally();
        (camera, tally)
    }
}

/// What a scan told.
#[derive(Clone, Debug, Default)]
pub struct Told {
    /// The camera's frames.
    pub frames: FrameCounts,
    /// Time left, when and for how many poses done.
    pub remaining: Vec<(Instant, u32, Duration)>,
    /// Poses given up.
    pub lost: Vec<LostPose>,
    /// What happened.
    pub notes: Vec<Note>,
}

impl Observer for Told {
    fn progress(&mut self, progress: &Progress) {
        if let Some(left) = progress.remaining {
            self.remaining.push((Instant::now(), progress.poses_done, left));
        }
    }

    fn camera(&mut self, frames: &FrameCounts) {
        self.frames = *frames;
    }

    fn pose_lost(&mut self, lost: &LostPose) {
        self.lost.push(lost.clone());
    }

    fn note(&mut self, note: &Note) {
        self.notes.push(note.clone());
    }
}

/// Scans the tiny instrument's plan into `session`.
///
/// # Panics
/// Where the session cannot be created or closed.
pub fn scan(
    tiny: &Tiny,
    map: &PixelMap,
    stage: &mut SerialStage,
    camera: &mut FaultyCamera<VirtualCamera>,
    session: &Path,
    cancel: &Cancel,
) -> (Outcome, Told) {
    let sample = SampleRecord { kind: ScanKind::Sample, ..SampleRecord::default() };
    let mut header = Header::new(tiny.description.clone(), tiny.plan.clone(), sample);
    header.devices = Devices { stage: stage.identity(), camera: camera.info() };
    let options = WriterOptions { overwrite: true, ..WriterOptions::default() };
    let mut writer = Writer::create(session, &header, options).expect("a session");
    let setup = Setup::new(tiny.description.clone(), tiny.plan.clone(), camera.info(), ScanKind::Sample);
    let mut told = Told::default();
    let outcome = runner::run(setup, map, stage, camera, &mut writer, cancel, &mut told);
    writer.finish().expect("closed");
    (outcome, told)
}
