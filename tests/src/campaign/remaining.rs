//! What is told of the time left after a tenth of a scan, against the time it then took.
//!
//! The scan engine and the virtual camera run in virtual time: each action takes what it takes on the instrument (moves by speed and acceleration,
//! exposures as chosen by the bracketing on rendered frames, fixed times for shutter, sensors, read-out and disk), so the figure does not
//! hang on what else the computer does. Paints from matt to glossy, plans of 40 to 96 poses. One scan in real time is told beside it.

use std::time::{Duration, Instant};

use gonio_acquisition::PixelMap;
use gonio_acquisition::bracket::Judge;
use gonio_acquisition::demand::{exposure_needs, interest};
use gonio_acquisition::engine::{Action, Engine, Event, Outcome, Setup, Step};
use gonio_driver::camera::CameraFaults;
use gonio_instrument::{Camera as _, Cancel, Misalignment, Plan, Pose, ScanKind, Sensors, builtin};
use gonio_sim::firmware::Faults;
use gonio_sim::optics::Sample;
use gonio_sim::world::World;
use gonio_sim::{Truth, VirtualCamera};

use super::instrument::{Tiny, scan};
use super::{Figure, Settings};

/// Paints by their model files, from matt to a metallic under a coat.
const PAINTS: &[&str] = &[
    r#"{"model":"lambert","diffuse":[0.5,0.5,0.5]}"#,
    r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.3,0.12,0.06],"specular":[0.1,0.08,0.12],"exponent":60.0}"#,
    r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.02,0.02,0.02],"specular":[0.3,0.3,0.3],"exponent":400.0}"#,
    r#"{"model":"ggx","diffuse":[0.05,0.02,0.02],"lobes":[{"specular":[0.45,0.12,0.08],"alpha":0.27,"r0":0.55}],"coat":{"index":1.5}}"#,
];

/// Speed and acceleration of the driver's moves.
const SPEED_DEG_S: f64 = 60.0;
const ACCELERATION_DEG_S2: f64 = 200.0;

/// Runs the campaign.
///
/// # Panics
/// Where the temporary folder cannot be written.
#[must_use]
pub fn figures(settings: &Settings) -> Vec<Figure> {
    let small = settings.share < 0.1;
    let (plans, paints) = if small { (&PLANS[..1], &PAINTS[..1]) } else { (PLANS, PAINTS) };
    let instrument = builtin::description("tiny").expect("built in").expect("readable");
    let map = PixelMap::new(&instrument);
    let (mut worst, mut course, mut scans) = (0.0f64, Vec::new(), 0);
    for &(tilts, spins) in plans {
        let plan = plan(tilts, spins);
        for paint in paints {
            let run = virtual_scan(&plan, paint, &map);
            worst = worst.max(run[0]);
            course.push(format!("{:.1}, {:.1}, {:.1} %", run[0] * 100.0, run[1] * 100.0, run[2] * 100.0));
            scans += 1;
        }
    }
    let size = format!("{scans} scans in virtual time");
    let mut figures = vec![
        Figure::time(
            settings,
            "time left told after a tenth of the scan, error, worst",
            100.0 * worst,
            "%",
            5.0,
            &size,
        ),
        Figure::told("the same after a tenth, a quarter, half of each", course.join("; "), &size),
    ];
    if !small {
        figures.push(real_scan(&map));
    }
    figures
}

/// Tilts and spins.
const PLANS: &[(u32, u32)] = &[(10, 4), (16, 6), (40, 1)];

fn plan(tilts: u32, spins: u32) -> Plan {
    let instrument = builtin::description("tiny").expect("built in").expect("readable");
    Plan {
        tilt_deg: (0..tilts).map(|n| 5.0 + 70.0 * f64::from(n) / f64::from(tilts - 1)).collect(),
        spin_deg: (0..spins).map(|n| 30.0 * f64::from(n)).collect(),
        ..instrument.plan
    }
}

/// Errors of what is told after a tenth, a quarter and half of the poses.
fn virtual_scan(plan: &Plan, paint: &str, map: &PixelMap) -> [f64; 3] {
    let instrument = builtin::description("tiny").expect("built in").expect("readable");
    let world = World::new(1e9);
    world.update(|state| state.lamp = 1.0);
    let truth = Truth::from_bytes(paint.as_bytes()).expect("a model");
    let sample = Sample::of_kind(ScanKind::Sample, &truth, &gonio_instrument::Certificate::virtual_white());
    let mut camera = VirtualCamera::new(
        world.clone(),
        &instrument,
        &Misalignment::default(),
        sample.expect("a sample"),
        1,
    );
    let mut setup = Setup::new(instrument.clone(), plan.clone(), camera.info(), ScanKind::Sample);
    setup.exposure_needs = exposure_needs(map, &setup.poses);
    let poses = plan.poses().len() as u32;
    let marks = [poses.div_ceil(10), poses / 4, poses / 2];
    let mut engine = Engine::new(setup);
    let (mut now, mut told, mut finished) = (0.0f64, [None; 3], 0.0);
    let (mut at, mut judge) = (Pose::default(), None);
    let after = Duration::from_secs_f64;
    loop {
        engine.handle(Event::Tick(after(now)));
        let action = match engine.step() {
            Step::Do(action) => action,
            Step::Wait => panic!("nothing to wait for"),
            Step::End(outcome) => {
                assert_eq!(outcome, Outcome::Done);
                break;
            }
        };
        let (event, took) = match action {
            Action::MoveTo { pose, .. } => {
                let took = motion_s(at, pose);
                at = pose;
                judge = None;
                world.update(|state| (state.actual, state.readback) = (pose, pose));
                (Event::Moved(pose), took)
            }
            Action::Capture { exposure, light } => {
                world.update(|state| state.shutter_open = light);
                let frame = camera.capture(exposure, &Cancel::new()).expect("a frame");
                let judge = judge.get_or_insert_with(|| Judge::new(&instrument.camera, &interest(map, at)));
                (Event::Frame(judge.judge(&frame)), frame.exposure.as_secs_f64() + 0.03)
            }
            Action::ReadSensors => {
                let sensors = Sensors {
                    lamp_monitor: 1.0,
                    temperature_c: 40.0,
                    sample_height_mm: 0.0,
                    interlock_closed: true,
                };
                (Event::Sensors(sensors), 0.004)
            }
            Action::Shutter(_) => (Event::Done, 0.06),
            Action::Home => (Event::Done, 3.0),
            Action::Lamp(_) => (Event::Done, 100.0),
            Action::EndPose => (Event::Done, 0.04),
            _ => (Event::Done, 0.001),
        };
        now += took;
        engine.handle(Event::Tick(after(now)));
        engine.handle(event);
        let progress = engine.progress();
        if progress.poses_done == poses && finished == 0.0 {
            finished = now;
        }
        for (mark, told) in marks.iter().zip(&mut told) {
            if progress.poses_done >= *mark && told.is_none() {
                *told = progress.remaining.map(|left| (now, left.as_secs_f64()));
            }
        }
    }
    told.map(|told| told.map_or(f64::INFINITY, |(then, left)| (left / (finished - then) - 1.0).abs()))
}

/// Trapezoid or triangle of speed over the longer way.
fn motion_s(from: Pose, to: Pose) -> f64 {
    let way =
        (from.tilt.degrees() - to.tilt.degrees()).abs().max((from.spin.degrees() - to.spin.degrees()).abs());
    let ramp = SPEED_DEG_S * SPEED_DEG_S / ACCELERATION_DEG_S2;
    if way > ramp {
        way / SPEED_DEG_S + SPEED_DEG_S / ACCELERATION_DEG_S2
    } else {
        2.0 * (way / ACCELERATION_DEG_S2).sqrt()
    }
}

/// A scan in real time, five times faster than life.
fn real_scan(map: &PixelMap) -> Figure {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = plan(10, 4);
    let poses = plan.poses().len() as u32;
    let tiny = Tiny::new(Some(plan), 5.0, Faults::default());
    let mut stage = tiny.stage(None, None).expect("a session");
    let (mut camera, _) = tiny.camera(CameraFaults::default(), 1);
    let (_, told) = scan(&tiny, map, &mut stage, &mut camera, &folder.path().join("s.mcap"), &Cancel::new());
    let at = |n: u32| told.remaining.iter().find(|r| r.1 >= n).copied();
    let value = match (at(poses.div_ceil(10)), at(poses)) {
        (Some((then, _, left)), Some((end, ..))) => {
            let took: Instant = end;
            let took = took.saturating_duration_since(then).as_secs_f64();
            format!("{:.1} s told, {took:.1} s taken", left.as_secs_f64())
        }
        _ => "the scan did not end".to_owned(),
    };
    Figure::told("one scan in real time, five times faster than life, after a tenth", value, "1 scan")
}
