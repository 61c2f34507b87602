//! What is told of the time left after a tenth of a scan, against the time it then took.
//!
//! Forty poses, ten tilts from 5° to 75° at four spins, on the tiny instrument five times faster than life, so that motion and exposure count and the computer's own
//! time little.

use std::time::Duration;

use gonio_acquisition::PixelMap;
use gonio_acquisition::engine::Outcome;
use gonio_driver::camera::CameraFaults;
use gonio_instrument::{Cancel, Plan, builtin};
use gonio_sim::firmware::Faults;

use super::instrument::{Tiny, scan};
use super::{Figure, Settings, grouped};

/// Runs the campaign.
///
/// # Panics
/// Where the temporary folder cannot be written.
#[must_use]
pub fn figures(settings: &Settings) -> Vec<Figure> {
    let scans = settings.count(5, 1);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("s.mcap");
    let small = settings.share < 0.1;
    let plan = plan(small);
    let poses = plan.poses().len() as u32;
    let tenth = poses.div_ceil(10);
    let (mut worst, mut longest, mut course) = (0.0f64, 0.0f64, String::new());
    let mut map = None;
    for _ in 0..scans {
        let tiny = Tiny::new(Some(plan.clone()), if small { 50.0 } else { 5.0 }, Faults::default());
        let map = map.get_or_insert_with(|| PixelMap::new(&tiny.description));
        let mut stage = tiny.stage(None, None).expect("a session");
        let (mut camera, _) = tiny.camera(CameraFaults::default(), 1);
        let (outcome, told) = scan(&tiny, map, &mut stage, &mut camera, &path, &Cancel::new());
        let end = told.remaining.iter().rev().find(|r| r.1 == poses).map(|r| r.0);
        let first = told.remaining.iter().find(|r| r.1 >= tenth);
        let (Some(end), Some(&(at, _, left)), Outcome::Done) = (end, first, outcome) else {
            worst = f64::INFINITY;
            continue;
        };
        let took = told.remaining.iter().find(|r| r.1 == poses).map_or(end, |r| r.0) - at;
        longest = longest.max(took.as_secs_f64());
        worst = worst.max(error(left, took));
        course = [tenth, poses / 4, poses / 2]
            .iter()
            .filter_map(|&n| told.remaining.iter().find(|r| r.1 >= n))
            .map(|&(then, _, left)| {
                format!("{:.1} %", 100.0 * error(left, end.saturating_duration_since(then)))
            })
            .collect::<Vec<_>>()
            .join(", ");
    }
    let size = format!("{} scans of {poses} poses, {longest:.0} s left each", grouped(scans));
    let bound = if small { 50.0 } else { 5.0 };
    vec![
        Figure::at_most("time left told after a tenth of the scan, error", 100.0 * worst, "%", bound, &size),
        Figure::told("the same after a tenth, a quarter, half of the last scan", course, &size),
    ]
}

fn error(told: Duration, took: Duration) -> f64 {
    (told.as_secs_f64() / took.as_secs_f64().max(1e-9) - 1.0).abs()
}

fn plan(small: bool) -> Plan {
    let instrument = builtin::description("tiny").expect("built in").expect("readable");
    let (tilts, spins) = if small { (5, 2) } else { (10, 4) };
    Plan {
        tilt_deg: (0..tilts).map(|n| 5.0 + 70.0 * f64::from(n) / f64::from(tilts - 1)).collect(),
        spin_deg: (0..spins).map(|n| 30.0 * f64::from(n)).collect(),
        ..instrument.plan
    }
}
