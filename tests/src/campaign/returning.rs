//! The plug is pulled in mid-scan and put back: how soon that is noticed, how soon the stage is back and its position checked, and what it costs.
//!
//! The port is a pseudo-terminal that is closed and opened again under another number; the firmware lives on. Every scan is pulled once, at a
//! random instant, for 50 ms to 1 s.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use gonio_acquisition::PixelMap;
use gonio_acquisition::engine::Outcome;
use gonio_driver::camera::CameraFaults;
use gonio_driver::stage::StageEvent;
use gonio_instrument::Cancel;
use gonio_recording::Session;
use gonio_sim::firmware::Faults;

use super::dice::Dice;
use super::instrument::{Events, Tiny, scan};
use super::{Figure, Settings, grouped};

/// Runs the campaign.
///
/// # Panics
/// Where the temporary folder cannot be written.
#[must_use]
pub fn figures(settings: &Settings) -> Vec<Figure> {
    let rounds = settings.count(200, 3);
    let mut dice = Dice::new(settings.seed, 40);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("s.mcap");
    let (mut noticed, mut back) = (Vec::new(), Vec::new());
    let (mut failed, mut repeated, mut pulled) = (0u64, 0u64, 0u64);
    let mut map = None;
    let mut whole_s = None::<f64>;
    for round in 0..=rounds {
        let tiny = Tiny::new(None, 50.0, Faults::default());
        let map = map.get_or_insert_with(|| PixelMap::new(&tiny.description));
        let events = Events::default();
        let mut stage = tiny.stage(None, Some(&events)).expect("a session");
        let (mut camera, _) = tiny.camera(CameraFaults::default(), 1);
        // the first scan is left alone, to know how long one takes
        let (after, away) = (whole_s.unwrap_or(0.0) * dice.fraction(), 0.05 + 0.95 * dice.fraction());
        let begun = Instant::now();
        if round == 0 {
            let (outcome, _) = scan(&tiny, map, &mut stage, &mut camera, &path, &Cancel::new());
            failed += u64::from(outcome != Outcome::Done);
            whole_s = Some(begun.elapsed().as_secs_f64());
            continue;
        }
        let (outcome, told, times) = std::thread::scope(|scope| {
            let pty = &tiny.pty;
            let hand = scope.spawn(move || {
                std::thread::sleep(Duration::from_secs_f64(after));
                // the port is gone at some time between this and the return of the pull
                let gone = Instant::now();
                pty.pull();
                std::thread::sleep(Duration::from_secs_f64(away));
                pty.plug();
                (gone, Instant::now())
            });
            let (outcome, told) = scan(&tiny, map, &mut stage, &mut camera, &path, &Cancel::new());
            (outcome, told, hand.join().expect("a hand"))
        });
        let events = events.lock().expect("not poisoned");
        let at = |wanted: fn(&StageEvent) -> bool| events.iter().find(|(_, e)| wanted(e)).map(|(at, _)| *at);
        let hung_up = at(|e| matches!(e, StageEvent::HungUp(_)));
        let returned = at(|e| matches!(e, StageEvent::Returned { .. }));
        // a pull after the last word of a scan is nobody's business
        if let (Some(hung_up), Some(returned)) = (hung_up, returned) {
            pulled += 1;
            noticed.push(hung_up.saturating_duration_since(times.0).as_secs_f64() * 1e3);
            back.push(returned.saturating_duration_since(times.1).as_secs_f64() * 1e3);
        }
        failed += u64::from(outcome != Outcome::Done);
        let again = told
            .notes
            .iter()
            .filter(|n| n.text.contains("begins anew") || n.text.contains("is given up"))
            .count();
        repeated = repeated.max(again as u64);
        failed += u64::from(!complete(&path));
    }
    let longest = |v: &[f64]| v.iter().copied().fold(0.0, f64::max);
    let size = format!("{} scans, {} pulled within", grouped(rounds), grouped(pulled));
    vec![
        Figure::time(settings, "hang-up to noticed, longest", longest(&noticed), "ms", 100.0, &size),
        Figure::time(settings, "port back to position checked, longest", longest(&back), "ms", 2000.0, &size),
        Figure::exactly("scans that did not end complete", failed, 0, &size),
        Figure::at_most("poses begun anew in one scan, most", repeated as f64, "", 1.0, &size),
        Figure::said("scans pulled within", pulled.to_string(), "≥ 1", &size, pulled >= 1),
    ]
}

/// Every pose of the plan once and whole.
fn complete(path: &std::path::Path) -> bool {
    let Ok(session) = Session::open(path) else { return false };
    let poses: BTreeMap<u32, usize> =
        session.poses().flatten().map(|p| (p.index, p.exposures.len())).collect();
    poses.len() == 6 && poses.values().all(|&frames| frames > 0) && session.finished()
}
