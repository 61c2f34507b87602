//! The scan engine under whatever can happen: it always ends, and never with light or motion left on.

use std::collections::BTreeSet;
use std::time::Duration;

use gonio_acquisition::bracket::FrameSummary;
use gonio_acquisition::engine::{Action, Choice, Engine, Event, Outcome, ScanError, Setup, Step};
use gonio_instrument::{CameraInfo, DeviceError, Pose, ScanKind, Sensors, builtin};
use gonio_recording::RecordingError;
use proptest::prelude::*;

fn setup(kind: ScanKind) -> Setup {
    let d = builtin::description("tiny").expect("known").expect("readable");
    let camera = CameraInfo { width: 160, height: 128, bits: 12, ..CameraInfo::default() };
    let plan = d.plan.clone();
    Setup::new(d, plan, camera, kind)
}

fn warm() -> Sensors {
    Sensors { lamp_monitor: 1.0, temperature_c: 40.0, sample_height_mm: 0.0, interlock_closed: true }
}

/// A scene whose brightest pixel saturates at 1 ms and whose darkest needs 0.5 s, after frames of at least `shortest` seconds.
fn summary(exposure: Duration, shortest: f64) -> FrameSummary {
    let t = exposure.as_secs_f64();
    FrameSummary {
        exposure_s: t,
        saturated_share: if shortest.min(t) > 1e-3 { 0.01 } else { 0.0 },
        dim_share: if t < 0.5 { 0.5 } else { 0.0 },
        dark_level: (0.2 * t / 0.5).min(0.3),
    }
}

/// The device as far as safety goes.
#[derive(Debug, Default)]
struct Model {
    shutter_open: bool,
    moving: bool,
    pose_open: bool,
    forced: bool,
    poses: BTreeSet<u32>,
    light_frames: u32,
    /// Shortest lit exposure of the pose, s.
    shortest: f64,
    log: Vec<String>,
}

/// What may go wrong at a step, or be asked for.
#[derive(Clone, Debug)]
enum Trouble {
    None,
    Fails(DeviceError),
    Journal,
    Abort,
    Emergency,
    Pause,
}

fn device_errors() -> impl Strategy<Value = DeviceError> {
    prop_oneof![
        Just(DeviceError::BadFrame { sequence: 1, reason: "torn".into() }),
        Just(DeviceError::Timeout { device: "d".into(), what: "w".into(), waited: Duration::from_secs(1) }),
        Just(DeviceError::Gone { device: "d".into() }),
        Just(DeviceError::NotRecorded { what: "pose".into() }),
        Just(DeviceError::Cancelled),
        Just(DeviceError::Fault { fault: "stall".into(), advice: "free the axis".into() }),
        Just(DeviceError::Suspended { fault: "interlock".into(), advice: "close the lid".into() }),
        Just(DeviceError::PositionsVoid { why: "has restarted".into() }),
    ]
}

fn troubles() -> impl Strategy<Value = Vec<Trouble>> {
    let one = prop_oneof![
        20 => Just(Trouble::None),
        2 => device_errors().prop_map(Trouble::Fails),
        1 => Just(Trouble::Journal),
        1 => Just(Trouble::Abort),
        1 => Just(Trouble::Emergency),
        1 => Just(Trouble::Pause),
    ];
    // quiet for a while, then trouble: every state gets its share
    (0usize..200, prop::collection::vec(one, 0..60)).prop_map(|(quiet, rest)| {
        let mut v = vec![Trouble::None; quiet];
        v.extend(rest);
        v
    })
}

impl Model {
    fn act(&mut self, action: &Action, fails: Option<Event>) -> Event {
        self.log.push(format!("{action:?} {}", if fails.is_some() { "fails" } else { "" }));
        match action {
            // a move or an opening that fails may have happened in part: the worst is assumed
            Action::MoveTo { .. } => self.moving = fails.is_some(),
            Action::Home => {
                assert!(!self.shutter_open);
                self.moving = fails.is_some();
            }
            Action::Shutter(true) => self.shutter_open = true,
            Action::Shutter(false) if fails.is_none() => self.shutter_open = false,
            // a device with a fault that passes has stopped
            Action::Rearm if fails.is_none() => self.moving = false,
            Action::StopMotion if fails.is_none() => self.moving = false,
            Action::EmergencyStop => {
                self.forced = true;
                self.moving = false;
                self.shutter_open = false;
            }
            Action::BeginPose { .. } if fails.is_none() => {
                assert!(!self.pose_open, "a pose inside another: {:?}", self.log);
                self.pose_open = true;
                self.shortest = f64::INFINITY;
            }
            Action::EndPose if fails.is_none() => self.pose_open = false,
            Action::GiveUpPose => self.pose_open = false,
            Action::Capture { light, .. } => {
                assert_eq!(*light, self.shutter_open, "{:?}", self.log);
                assert!(self.pose_open && !self.moving, "{:?}", self.log);
                self.light_frames += u32::from(*light);
            }

            _ => {}
        }
        if let Some(e) = fails {
            return e;
        }
        match action {
            Action::MoveTo { pose, index } => {
                self.poses.insert(*index);
                Event::Moved(*pose)
            }
            Action::ReadSensors => Event::Sensors(warm()),
            Action::Capture { exposure, light } => {
                let event = Event::Frame(summary(*exposure, self.shortest));
                if *light {
                    self.shortest = self.shortest.min(exposure.as_secs_f64());
                }
                event
            }
            _ => Event::Done,
        }
    }
}

fn journal_error() -> RecordingError {
    RecordingError::DiskFull { path: "s.mcap".into(), written: 0 }
}

fn play(mut engine: Engine, troubles: &[Trouble]) -> (Outcome, Model) {
    let mut model = Model { shutter_open: true, ..Model::default() };
    for k in 0..5000 {
        let trouble = troubles.get(k).cloned().unwrap_or(Trouble::None);
        match trouble {
            Trouble::Abort => engine.handle(Event::Abort),
            Trouble::Emergency => engine.handle(Event::Emergency),
            Trouble::Pause => engine.handle(Event::Pause),
            _ => {}
        }
        engine.handle(Event::Tick(Duration::from_secs(k as u64)));
        match engine.step() {
            Step::Do(action) => {
                let recording =
                    matches!(action, Action::Record { .. } | Action::EndPose | Action::BeginPose { .. });
                let fails = match trouble {
                    Trouble::Fails(e) => Some(Event::Failed(e)),
                    Trouble::Journal if recording => Some(Event::JournalFailed(journal_error())),
                    _ => None,
                };
                let event = model.act(&action, fails);
                engine.handle(event);
            }
            Step::Wait => engine.handle(Event::Resume),
            Step::End(outcome) => return (outcome, model),
        }
        let p = engine.progress();
        assert!(p.poses_done <= p.poses_total && p.exposures_done <= p.exposures_total);
    }
    panic!("no end: {:?}", &model.log[model.log.len() - 40..]);
}

#[test]
fn a_scan_without_trouble_takes_every_pose_with_a_bracket_that_spans_the_scene() {
    let (outcome, model) = play(Engine::new(setup(ScanKind::Sample)), &[]);
    assert_eq!(outcome, Outcome::Done);
    assert_eq!(model.poses.len(), 6);
    assert!(!model.shutter_open && !model.pose_open && !model.forced);
    // 1 ms to 0.75 s in steps of 4.5 takes six exposures, eight at most with the first guess and a shorter step
    assert!((24..=48).contains(&model.light_frames), "{}", model.light_frames);
}

#[test]
fn a_resumed_scan_takes_what_is_left() {
    let done: BTreeSet<u32> = [0, 1, 3].into();
    let (outcome, model) = play(Engine::new(setup(ScanKind::Sample).resuming(done)), &[]);
    assert_eq!(outcome, Outcome::Done);
    assert_eq!(model.poses, [2, 4, 5].into());
}

#[test]
fn a_choice_between_poses_changes_their_order_or_ends_the_scan() {
    let mut engine = Engine::new(setup(ScanKind::Sample));
    let (mut model, mut order) = (Model { shutter_open: true, ..Model::default() }, Vec::new());
    engine.choose(Choice::Enough);
    assert_eq!(engine.ahead(), [0, 1, 2, 3, 4, 5], "before the first pose nothing is chosen");
    let outcome = loop {
        match engine.step() {
            Step::Do(action) => {
                let event = model.act(&action, None);
                engine.handle(event);
                if let Action::BeginPose { index, .. } = action {
                    order.push(index);
                    // in the middle of a pose nothing changes
                    engine.choose(Choice::Enough);
                }
                if action == Action::EndPose {
                    engine.choose(match order.len() {
                        1 => Choice::This(4),
                        2 => Choice::This(0),
                        3 => Choice::This(5),
                        _ => Choice::Enough,
                    });
                    let p = engine.progress();
                    assert_eq!((p.poses_done as usize, p.poses_total), (order.len(), 6));
                }
            }
            Step::Wait => panic!("nobody asked for a pause"),
            Step::End(outcome) => break outcome,
        }
    };
    assert_eq!(outcome, Outcome::Done);
    // a place that is not ahead (0 is done) leaves the plan's order: 1 follows 4
    assert_eq!(order, [0, 4, 1, 5]);
    assert!(!model.shutter_open && !model.pose_open && !model.forced && !model.moving);
    assert_eq!(model.log.last().map(String::as_str), Some("Lamp(0.0) "), "{:?}", model.log.last());
}

#[test]
fn a_dark_scan_never_opens_the_shutter() {
    let (outcome, model) = play(Engine::new(setup(ScanKind::Dark)), &[]);
    assert_eq!(outcome, Outcome::Done);
    assert_eq!(model.light_frames, 0);
    assert!(model.log.iter().all(|l| !l.starts_with("Shutter(true)") && !l.starts_with("Lamp(1")));
}

#[test]
fn frames_that_come_damaged_are_taken_again_and_their_pose_is_given_up_at_last() {
    let bad = || Trouble::Fails(DeviceError::BadFrame { sequence: 1, reason: "torn".into() });
    // the first capture is the eighth action: journal, sensors, shutter, home, lamp, move, begin
    let mut troubles = vec![Trouble::None; 7];
    troubles.push(bad());
    let (outcome, model) = play(Engine::new(setup(ScanKind::Sample)), &troubles);
    assert_eq!(outcome, Outcome::Done, "{:?}", model.log);
    troubles.extend([bad(), bad()]);
    let (outcome, model) = play(Engine::new(setup(ScanKind::Sample)), &troubles);
    let Outcome::Partial { lost } = outcome else { panic!("{outcome:?} {:?}", model.log) };
    assert!(lost.len() == 1 && lost[0].index == 0 && lost[0].reason.contains("torn"), "{lost:?}");
}

/// An engine at a place of the scan, told by what it asks for.
fn until(engine: &mut Engine, model: &mut Model, wanted: impl Fn(&Action) -> bool) {
    for k in 0..2000 {
        engine.handle(Event::Tick(Duration::from_millis(10 * k)));
        let Step::Do(action) = engine.step() else { panic!("no action") };
        if wanted(&action) {
            return;
        }
        let event = model.act(&action, None);
        engine.handle(event);
    }
    panic!("never asked for: {:?}", model.log);
}

#[test]
fn an_open_lid_is_waited_for_and_the_frame_it_spoilt_is_taken_again() {
    let mut engine = Engine::new(setup(ScanKind::Sample));
    let mut model = Model::default();
    until(&mut engine, &mut model, |a| matches!(a, Action::Capture { light: true, .. }));
    let lid = || DeviceError::Suspended { fault: "an open interlock".into(), advice: "close the lid".into() };
    engine.handle(Event::Failed(lid()));
    assert_eq!(engine.step(), Step::Do(Action::Shutter(false)));
    engine.handle(Event::Done);
    assert!(engine.suspended().is_some_and(|s| s.contains("close the lid")));
    let mut waited = 0;
    for k in 0..100u64 {
        engine.handle(Event::Tick(Duration::from_secs(100) + Duration::from_millis(100 * k)));
        match engine.step() {
            Step::Wait => waited += 1,
            Step::Do(Action::Rearm) => engine.handle(Event::Failed(lid())),
            other => panic!("{other:?}"),
        }
    }
    assert!(waited > 80, "looked at once a second: {waited} waits");
    engine.handle(Event::Tick(Duration::from_secs(200)));
    assert_eq!(engine.step(), Step::Do(Action::Rearm));
    engine.handle(Event::Done);
    assert_eq!(engine.step(), Step::Do(Action::Lamp(1.0)), "the lid has put the lamp out");
    engine.handle(Event::Done);
    assert_eq!(engine.step(), Step::Do(Action::Shutter(true)));
    engine.handle(Event::Done);
    assert!(matches!(engine.step(), Step::Do(Action::Capture { light: true, .. })));
    assert!(engine.take_notes().iter().any(|n| n.text.contains("goes on after")));
}

#[test]
fn a_lamp_that_was_put_out_is_lit_again_and_one_that_stays_dark_ends_the_scan() {
    let mut engine = Engine::new(setup(ScanKind::Sample));
    let mut model = Model::default();
    let dark = || Event::Sensors(Sensors { lamp_monitor: 0.0, ..warm() });
    let mut seconds = 0;
    for comes_back in [true, true, false] {
        until(&mut engine, &mut model, |a| matches!(a, Action::Capture { light: true, .. }));
        engine.handle(Event::Frame(summary(Duration::from_millis(1), f64::INFINITY)));
        assert_eq!(engine.step(), Step::Do(Action::ReadSensors));
        engine.handle(dark());
        for wanted in [Action::Shutter(false), Action::Rearm, Action::Lamp(1.0), Action::Shutter(true)] {
            seconds += 2;
            engine.handle(Event::Tick(Duration::from_secs(100 + seconds)));
            assert_eq!(engine.step(), Step::Do(wanted));
            engine.handle(Event::Done);
        }
        let Step::Do(Action::Capture { light: true, .. }) = engine.step() else {
            panic!("the frame is taken again");
        };
        engine.handle(Event::Frame(summary(Duration::from_millis(1), f64::INFINITY)));
        assert_eq!(engine.step(), Step::Do(Action::ReadSensors));
        engine.handle(if comes_back { Event::Sensors(warm()) } else { dark() });
    }
    let outcome = loop {
        match engine.step() {
            Step::Do(action) => engine.handle(model.act(&action, None)),
            Step::End(outcome) => break outcome,
            Step::Wait => panic!("nothing to wait for"),
        }
    };
    assert!(
        matches!(&outcome, Outcome::Failed { error: ScanError::Device(e), .. } if e.to_string().contains("the lamp is out"))
    );
    assert!(engine.take_notes().iter().any(|n| n.text.contains("it is lit again")));
}

#[test]
fn what_does_not_pass_ends_the_scan_at_the_end_of_patience() {
    let mut engine = Engine::new(setup(ScanKind::Sample));
    let mut model = Model::default();
    until(&mut engine, &mut model, |a| matches!(a, Action::Capture { light: true, .. }));
    engine.handle(Event::Frame(summary(Duration::from_millis(1), f64::INFINITY)));
    assert_eq!(engine.step(), Step::Do(Action::ReadSensors));
    engine.handle(Event::Sensors(Sensors { temperature_c: 95.0, ..warm() }));
    let mut seconds = 0;
    let outcome = loop {
        seconds += 1;
        engine.handle(Event::Tick(Duration::from_secs(seconds)));
        match engine.step() {
            Step::Do(Action::ReadSensors) => {
                engine.handle(Event::Sensors(Sensors { temperature_c: 95.0, ..warm() }));
            }
            Step::Do(_) => engine.handle(Event::Done),
            Step::Wait => {}
            Step::End(outcome) => break outcome,
        }
        assert!(seconds < 2000, "no end");
    };
    assert!((600..700).contains(&seconds), "{seconds} s");
    assert!(
        matches!(&outcome, Outcome::Failed { error: ScanError::Device(e), .. } if e.to_string().contains("95.0 °C"))
    );
}

#[test]
fn a_restarted_device_is_homed_and_the_pose_under_way_begun_anew() {
    let mut engine = Engine::new(setup(ScanKind::Sample));
    let mut model = Model::default();
    until(&mut engine, &mut model, |a| matches!(a, Action::MoveTo { index: 2, .. }));
    engine.handle(Event::Moved(Pose::default()));
    until(&mut engine, &mut model, |a| matches!(a, Action::Capture { light: true, .. }));
    engine.handle(Event::Failed(DeviceError::PositionsVoid { why: "has restarted".into() }));
    let mut asked = Vec::new();
    until(&mut engine, &mut model, |a| matches!(a, Action::Home));
    engine.handle(Event::Done);
    loop {
        let Step::Do(action) = engine.step() else { panic!("no action") };
        asked.push(action.clone());
        if matches!(action, Action::Capture { .. }) {
            break;
        }
        let event = model.act(&action, None);
        engine.handle(event);
    }
    assert!(
        matches!(asked[0], Action::Lamp(_)) && matches!(asked[1], Action::MoveTo { index: 2, .. }),
        "{asked:?}"
    );
    let (outcome, _) = (
        loop {
            match engine.step() {
                Step::Do(a) => {
                    let event = model.act(&a, None);
                    engine.handle(event);
                }
                Step::Wait => panic!("nobody asked for a pause"),
                Step::End(o) => break o,
            }
        },
        (),
    );
    assert_eq!(outcome, Outcome::Done);
}

#[test]
fn a_last_move_that_fails_is_followed_by_a_stop() {
    let (_, whole) = play(Engine::new(setup(ScanKind::Dark)), &[]);
    let last_move = whole.log.iter().rposition(|l| l.starts_with("MoveTo")).expect("moves");
    let mut troubles = vec![Trouble::None; last_move];
    troubles.push(Trouble::Fails(DeviceError::NotRecorded { what: "pose".into() }));
    let (outcome, model) = play(Engine::new(setup(ScanKind::Dark)), &troubles);
    assert!(matches!(&outcome, Outcome::Partial { lost } if lost[0].index == 5), "{outcome:?}");
    assert!(
        !model.moving && model.log.last().is_some_and(|l| l.starts_with("StopMotion")),
        "{:?}",
        model.log
    );
}

#[test]
fn what_does_not_fit_is_refused_before_anything_moves() {
    let mut s = setup(ScanKind::Sample);
    s.camera.width = 1280;
    let (outcome, model) = play(Engine::new(s), &[]);
    assert!(matches!(outcome, Outcome::Refused(_)) && model.log.is_empty());

    let mut engine = Engine::new(setup(ScanKind::Sample));
    let mut log = Vec::new();
    let outcome = loop {
        match engine.step() {
            Step::Do(a) => {
                let e = match a {
                    Action::ReadSensors => Event::Sensors(Sensors { sample_height_mm: 0.7, ..warm() }),
                    _ => Event::Done,
                };
                log.push(a);
                engine.handle(e);
            }
            Step::Wait => panic!("nobody asked for a pause"),
            Step::End(o) => break o,
        }
    };
    let Outcome::Refused(e) = outcome else { panic!("{outcome:?}") };
    assert!(e.to_string().contains("0.700"), "{e}");
    assert!(!log.iter().any(|a| matches!(a, Action::Home | Action::MoveTo { .. } | Action::Lamp(1.0))));
}

#[test]
fn a_full_disk_ends_the_scan_with_the_poses_before_it() {
    let mut troubles = vec![Trouble::None; 100];
    troubles.extend(vec![Trouble::Journal; 30]);
    let (outcome, model) = play(Engine::new(setup(ScanKind::Sample)), &troubles);
    assert!(
        matches!(outcome, Outcome::Failed { error: ScanError::Journal(_), remaining: 1..=5 }),
        "{outcome:?}"
    );
    assert!(!model.shutter_open && !model.pose_open);
}

#[test]
fn a_pause_holds_and_resumes() {
    let mut engine = Engine::new(setup(ScanKind::Sample));
    engine.handle(Event::Pause);
    assert_eq!(engine.step(), Step::Wait);
    engine.handle(Event::Resume);
    assert_eq!(engine.step(), Step::Do(Action::CheckJournal));
    // asked again while under way, the same action is under way
    assert_eq!(engine.step(), Step::Do(Action::CheckJournal));
    engine.handle(Event::Moved(Pose::default()));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn however_it_ends_light_and_motion_are_off(troubles in troubles(), kind in 0..3usize) {
        let kind = [ScanKind::Sample, ScanKind::White, ScanKind::Dark][kind];
        let (outcome, model) = play(Engine::new(setup(kind)), &troubles);
        prop_assert!(!model.shutter_open, "{outcome:?} {:?}", model.log);
        prop_assert!(!model.moving, "{outcome:?} {:?}", model.log);
        prop_assert!(!model.pose_open, "{outcome:?} {:?}", model.log);
        if outcome == Outcome::Done {
            prop_assert_eq!(model.poses.len(), 6);
        }
    }
}
