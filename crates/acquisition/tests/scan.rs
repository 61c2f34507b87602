//! Whole scans over devices made of the forward model: engine, runner, journal, white reference, reducer.

mod forward;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use forward::{Noise, coarse, frame, rates};
use gonio_acquisition::reference_plan::white_plan;
use gonio_acquisition::runner::FrameCounts;
use gonio_acquisition::{
    AcquisitionError, Journal, Observer, Options, Outcome, PixelMap, Reducer, Setup, WhiteBuilder,
    WhiteReference, reference, run,
};
use gonio_brdf::models::{AshikhminShirleySimplified, Lambert};
use gonio_brdf::{Brdf, Flag, Grid, Measured};
use gonio_instrument::{
    Camera, CameraInfo, Cancel, Certificate, Description, DeviceError, Exposure, Frame, LinkStatistics, Plan,
    Pose, PoseRecord, SampleRecord, ScanKind, Sensors, Stage, StageIdentity,
};
use gonio_recording::RecordingError;

const GAIN: f64 = 2.0e5;

/// What stage and camera share.
struct Scene {
    description: Description,
    brdf: Box<dyn Brdf>,
    pose: Pose,
    shutter_open: bool,
    stopped: u32,
    sequence: u64,
    rates: BTreeMap<(i64, i64), Vec<f64>>,
    /// Frames with these sequence numbers come damaged.
    bad: Vec<u64>,
    /// Raised when this many frames were taken.
    cancel_after: Option<(u64, Cancel)>,
}

type Shared = Arc<Mutex<Scene>>;

struct FakeStage(Shared);
struct FakeCamera(Shared);

impl Stage for FakeStage {
    fn identity(&self) -> StageIdentity {
        StageIdentity::default()
    }
    fn home(&mut self, _: &Cancel) -> Result<(), DeviceError> {
        Ok(())
    }
    fn move_to(&mut self, pose: Pose, _: &Cancel) -> Result<Pose, DeviceError> {
        let mut s = self.0.lock().expect("lock");
        assert!(!s.shutter_open, "moves with the shutter open");
        s.pose = pose;
        Ok(pose)
    }
    fn set_shutter(&mut self, open: bool) -> Result<(), DeviceError> {
        self.0.lock().expect("lock").shutter_open = open;
        Ok(())
    }
    fn set_lamp(&mut self, _: f64, _: &Cancel) -> Result<(), DeviceError> {
        Ok(())
    }
    fn sensors(&mut self) -> Result<Sensors, DeviceError> {
        Ok(Sensors { lamp_monitor: 1.0, temperature_c: 40.0, sample_height_mm: 0.01, interlock_closed: true })
    }
    fn stop(&mut self) -> Result<(), DeviceError> {
        self.0.lock().expect("lock").stopped += 1;
        Ok(())
    }
    fn emergency_stop(&mut self) -> Result<(), DeviceError> {
        self.0.lock().expect("lock").shutter_open = false;
        Ok(())
    }
    fn rearm(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
    fn statistics(&self) -> LinkStatistics {
        LinkStatistics::default()
    }
}

impl Camera for FakeCamera {
    fn info(&self) -> CameraInfo {
        let s = self.0.lock().expect("lock");
        let [width, height] = s.description.camera.size;
        CameraInfo { width, height, bits: 12, ..CameraInfo::default() }
    }
    fn capture(&mut self, exposure: Duration, cancel: &Cancel) -> Result<Frame, DeviceError> {
        if cancel.is_raised() {
            return Err(DeviceError::Cancelled);
        }
        let mut s = self.0.lock().expect("lock");
        s.sequence += 1;
        let sequence = s.sequence;
        if let Some((n, c)) = &s.cancel_after
            && sequence >= *n
        {
            c.stop();
        }
        if s.bad.contains(&sequence) {
            return Err(DeviceError::BadFrame { sequence, reason: "torn".into() });
        }
        let key =
            ((s.pose.tilt.degrees() * 1e6).round() as i64, (s.pose.spin.degrees() * 1e6).round() as i64);
        let (d, pose) = (s.description.clone(), s.pose);
        if !s.rates.contains_key(&key) {
            let r = rates(&d, s.brdf.as_ref(), pose, GAIN);
            s.rates.insert(key, r);
        }
        let lit = s.rates[&key].clone();
        let signal = if s.shutter_open { lit } else { vec![0.0; lit.len()] };
        Ok(frame(&d, &signal, exposure.as_secs_f64(), 1.0, sequence, &mut Some(Noise(sequence * 7919))))
    }
}

fn devices(d: &Description, brdf: Box<dyn Brdf>) -> (Shared, FakeStage, FakeCamera) {
    let scene = Arc::new(Mutex::new(Scene {
        description: d.clone(),
        brdf,
        pose: Pose::default(),
        shutter_open: true,
        stopped: 0,
        sequence: 0,
        rates: BTreeMap::new(),
        bad: Vec::new(),
        cancel_after: None,
    }));
    (scene.clone(), FakeStage(scene.clone()), FakeCamera(scene))
}

/// A journal in memory that breaks its rules loudly.
#[derive(Default)]
struct Memory {
    open: Option<u32>,
    ended: Vec<u32>,
    frames: usize,
    full_after: Option<usize>,
}

impl Journal for Memory {
    fn check(&mut self) -> Result<(), RecordingError> {
        Ok(())
    }
    fn begin_pose(&mut self, index: u32, _: Pose, _: Pose) -> Result<(), RecordingError> {
        assert_eq!(self.open, None);
        self.open = Some(index);
        Ok(())
    }
    fn frame(&mut self, _: &Exposure, _: Duration) -> Result<(), RecordingError> {
        assert!(self.open.is_some());
        self.frames += 1;
        match self.full_after {
            Some(n) if self.frames > n => Err(RecordingError::DiskFull { path: "s.mcap".into(), written: 0 }),
            _ => Ok(()),
        }
    }
    fn end_pose(&mut self) -> Result<(), RecordingError> {
        self.ended.push(self.open.take().expect("open"));
        Ok(())
    }
    fn give_up_pose(&mut self) -> Result<(), RecordingError> {
        self.open = None;
        Ok(())
    }
    fn sensors(&mut self, _: &Sensors) -> Result<(), RecordingError> {
        Ok(())
    }
    fn event(&mut self, _: bool, _: &str) -> Result<(), RecordingError> {
        Ok(())
    }
}

#[derive(Default)]
struct Keep(Vec<PoseRecord>);

impl Observer for Keep {
    fn pose_done(&mut self, record: PoseRecord) {
        self.0.push(record);
    }
}

fn setup(d: &Description, plan: &Plan, kind: ScanKind) -> Setup {
    let [width, height] = d.camera.size;
    let camera = CameraInfo { width, height, bits: 12, ..CameraInfo::default() };
    Setup::new(d.clone(), plan.clone(), camera, kind)
}

fn scan(
    d: &Description,
    map: &PixelMap,
    plan: &Plan,
    kind: ScanKind,
    brdf: Box<dyn Brdf>,
) -> Vec<PoseRecord> {
    let (scene, mut stage, mut camera) = devices(d, brdf);
    let (mut journal, mut keep) = (Memory::default(), Keep::default());
    let outcome =
        run(setup(d, plan, kind), map, &mut stage, &mut camera, &mut journal, &Cancel::new(), &mut keep);
    assert_eq!(outcome, Outcome::Done);
    assert!(!scene.lock().expect("lock").shutter_open);
    assert_eq!(journal.ended.len(), plan.poses().len());
    keep.0
}

fn truth() -> AshikhminShirleySimplified {
    AshikhminShirleySimplified { diffuse: [0.3, 0.1, 0.05], specular: [0.04; 3], exponent: 30.0 }
}

fn coarse_grid() -> Options {
    Options {
        grid: Grid {
            theta_i_deg: vec![0.0, 25.0, 50.0, 75.0, 90.0],
            theta_o_deg: (0..19).map(|k| f64::from(k) * 5.0).collect(),
            phi_deg: (0..19).map(|k| f64::from(k) * 10.0).collect(),
        },
        ..Options::default()
    }
}

fn white(d: &Description, map: &Arc<PixelMap>, plan: &Plan, options: &Options) -> WhiteReference {
    let mut builder =
        WhiteBuilder::new(map.clone(), &Certificate::virtual_white(), Vec::new(), options).expect("builds");
    let plan = white_plan(map, plan);
    for r in scan(d, map, &plan, ScanKind::White, Box::new(Lambert { diffuse: [0.98; 3] })) {
        builder.add_pose(&r).expect("adds");
    }
    builder.finish().expect("covers")
}

fn reduce(
    map: &Arc<PixelMap>,
    white: &WhiteReference,
    records: &[PoseRecord],
    options: &Options,
) -> Measured {
    let mut r =
        Reducer::new(map.clone(), white.clone(), SampleRecord::default(), options.clone()).expect("builds");
    for p in records {
        r.add_pose(p).expect("adds");
        assert!(r.snapshot().flag.contains(&Flag::Measured));
    }
    r.finish()
}

fn plan() -> Plan {
    let mut p = coarse(8).plan;
    p.tilt_deg = vec![25.0, 50.0, 75.0];
    p
}

#[test]
fn a_scan_and_its_reduction_meet_the_truth_and_are_the_same_on_any_number_of_threads() {
    let d = coarse(8);
    let map = Arc::new(PixelMap::new(&d));
    let options = coarse_grid();
    let white = white(&d, &map, &plan(), &options);
    let records = scan(&d, &map, &plan(), ScanKind::Sample, Box::new(truth()));
    // dark frames come with the first pose alone
    let dark = |r: &PoseRecord| r.exposures.iter().filter(|e| !e.shutter_open).count();
    assert_eq!(records.iter().map(dark).collect::<Vec<_>>(), [8, 0, 0]);
    let on = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("pool")
            .install(|| reduce(&map, &white, &records, &options))
    };
    let (one, five) = (on(1), on(5));
    assert_eq!(one, five);
    let bits = |m: &Measured| -> Vec<u32> {
        m.values.iter().chain(&m.sigma).flatten().map(|v| v.to_bits()).collect()
    };
    assert_eq!(bits(&one), bits(&five));

    let (mut within1, mut within3, mut n) = (0, 0, 0);
    for i in 0..one.grid.len() {
        let (v, s) = (one.values[i], one.sigma[i]);
        assert!(v.iter().chain(&s).all(|x| x.is_finite() && *x >= 0.0), "{:?}", one.grid.coordinates(i));
        if one.flag[i] != Flag::Measured {
            continue;
        }
        let t =
            gonio_brdf::average::cell_mean(&truth(), &one.grid, one.meaning, one.grid.coordinates(i), 6, 2);
        for c in [0, 1, 2] {
            let z = ((f64::from(v[c]) - t[c]) / f64::from(s[c])).abs();
            n += 1;
            within1 += usize::from(z <= 1.0);
            within3 += usize::from(z <= 3.0);
        }
    }
    let share = |k: usize| k as f64 / f64::from(n);
    assert!(n > 2000 && share(within3) > 0.985, "{n} {}", share(within3));
    assert!((0.58..0.78).contains(&share(within1)), "{}", share(within1));
    // every cell of the rows measured and beyond has some value
    assert!(one.flag.iter().filter(|f| **f == Flag::Invalid).count() < one.flag.len() / 4);
    assert!(one.attributes.keys().all(|k| !k.contains("time") && !k.contains("host") && !k.contains("path")));
}

#[test]
fn a_stop_in_mid_pose_keeps_the_poses_before_it_and_leaves_the_shutter_closed() {
    let d = coarse(16);
    let map = PixelMap::new(&d);
    let (scene, mut stage, mut camera) = devices(&d, Box::new(truth()));
    let cancel = Cancel::new();
    scene.lock().expect("lock").cancel_after = Some((17, cancel.clone()));
    let (mut journal, mut keep) = (Memory::default(), Keep::default());
    let s = setup(&d, &plan(), ScanKind::Sample);
    let outcome = run(s, &map, &mut stage, &mut camera, &mut journal, &cancel, &mut keep);
    let Outcome::Aborted { emergency: false, remaining } = outcome else { panic!("{outcome:?}") };
    assert_eq!(remaining as usize + keep.0.len(), 3);
    assert_eq!(journal.ended.len(), keep.0.len());
    let scene = scene.lock().expect("lock");
    assert!(!scene.shutter_open && scene.stopped > 0 && journal.open.is_none());
}

#[test]
fn a_full_disk_is_told_and_leaves_the_device_safe() {
    let d = coarse(16);
    let map = PixelMap::new(&d);
    let (scene, mut stage, mut camera) = devices(&d, Box::new(truth()));
    let mut journal = Memory { full_after: Some(10), ..Memory::default() };
    let s = setup(&d, &plan(), ScanKind::Sample);
    let outcome = run(s, &map, &mut stage, &mut camera, &mut journal, &Cancel::new(), &mut ());
    let Outcome::Failed { error, remaining: 3 } = outcome else { panic!("{outcome:?}") };
    assert!(error.to_string().contains("--resume"), "{error}");
    assert!(!scene.lock().expect("lock").shutter_open && journal.open.is_none());
}

#[test]
fn a_torn_frame_is_taken_again() {
    let d = coarse(16);
    let map = PixelMap::new(&d);
    let (scene, mut stage, mut camera) = devices(&d, Box::new(truth()));
    scene.lock().expect("lock").bad = vec![3, 12, 13];
    let (mut journal, mut keep) = (Memory::default(), Keep::default());
    let s = setup(&d, &plan(), ScanKind::Sample);
    let outcome = run(s, &map, &mut stage, &mut camera, &mut journal, &Cancel::new(), &mut keep);
    assert_eq!(outcome, Outcome::Done);
    assert_eq!(keep.0.len(), 3);
}

/// A camera that never gives a frame in time.
struct Deaf(FakeCamera, u64);

impl Camera for Deaf {
    fn info(&self) -> CameraInfo {
        self.0.info()
    }
    fn capture(&mut self, exposure: Duration, _: &Cancel) -> Result<Frame, DeviceError> {
        self.1 += 1;
        Err(DeviceError::Timeout { device: "deaf".into(), what: "a frame".into(), waited: exposure })
    }
}

#[derive(Default)]
struct Counted(FrameCounts);

impl Observer for Counted {
    fn camera(&mut self, frames: &FrameCounts) {
        self.0 = *frames;
    }
}

#[test]
fn frames_that_never_came_are_told_even_where_none_follows() {
    let d = coarse(16);
    let map = PixelMap::new(&d);
    let (_, mut stage, camera) = devices(&d, Box::new(truth()));
    let (mut deaf, mut counted) = (Deaf(camera, 0), Counted::default());
    let s = setup(&d, &plan(), ScanKind::Sample);
    let outcome = run(s, &map, &mut stage, &mut deaf, &mut Memory::default(), &Cancel::new(), &mut counted);
    assert!(!matches!(outcome, Outcome::Done), "{outcome:?}");
    assert!(deaf.1 > 0 && counted.0.timed_out == deaf.1, "{} captures, told {:?}", deaf.1, counted.0);
}

#[test]
fn stale_and_foreign_references_are_refused_unless_accepted() {
    let d = coarse(8);
    let mut old = Certificate::virtual_white();
    old.expires = "2020-01-01".into();
    let e = reference::validate(&old, &d, &d, "2026-11-22", false);
    assert!(matches!(e, Err(AcquisitionError::Expired { .. })), "{e:?}");
    let notes = reference::validate(&old, &d, &d, "2026-11-22", true).expect("accepted");
    assert!(notes.len() == 1 && notes[0].contains("2020-01-01") && !notes[0].contains("2026"), "{notes:?}");
    let mut other = d.clone();
    other.camera.f_mm = 3.1;
    let e = reference::validate(&Certificate::virtual_white(), &other, &d, "2026-11-22", false);
    assert!(matches!(e, Err(AcquisitionError::OtherInstrument { part: "camera", .. })), "{e:?}");
}
