//! The host process is killed at random instants of a scan of the tiny instrument, whose device lives on in a process of its own.
//!
//! Half of the instants are drawn over the time of a whole scan, half over the time of a pose after a pose was announced as done.
//! Before each killing scan nothing is cleaned up but the session. What was announced as done before the kill must be in the file, the
//! session must go on with `--resume`, and every frame of the result must be that of the uninterrupted scan: pixels, exposure, lamp
//! monitor, shutter, read-back pose, bit for bit. A frame that the log tells as taken again (on a computer too busy to hear the device in time) has
//! noise of its own, as on a real camera; such scans are told apart.

use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use gonio_instrument::PoseRecord;
use gonio_recording::{Session, Status, verify};

use super::dice::Dice;
use super::{Figure, Settings, grouped};

const PAINT: &str = r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.3,0.12,0.06],"specular":[0.1,0.08,0.12],"exponent":60.0}"#;

struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs the campaign.
///
/// # Panics
/// Where the program or the virtual instrument cannot be started.
#[must_use]
pub fn figures(settings: &Settings) -> Vec<Figure> {
    let kills = settings.count(1000, 4);
    let mut dice = Dice::new(settings.seed, 50);
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(at.join("paint.json"), PAINT).expect("written");
    let _device = device(settings, at);
    let begun = Instant::now();
    assert!(run(settings, at, "whole.mcap", false), "the uninterrupted scan");
    let whole_s = begun.elapsed().as_secs_f64();
    let whole = poses(&at.join("whole.mcap")).expect("the uninterrupted scan");
    let table = replay(settings, at, "whole.mcap");

    let (mut lost, mut unlike, mut failed, mut unreadable, mut tables, mut other_tables) =
        (0u64, 0u64, 0u64, 0u64, 0u64, 0u64);
    let mut again = 0u64;
    let mut by_done = [0u64; 8];
    for n in 0..kills {
        if n > 0 && n % 50 == 0 {
            eprintln!("{n} of {kills} kills, {unlike} unlike");
        }
        let session = at.join("s.mcap");
        for old in ["s.mcap", "s.2.mcap", "s.3.mcap", "s.nc"] {
            let _ = std::fs::remove_file(at.join(old));
        }
        let when = if n % 2 == 0 {
            When::After(whole_s * dice.fraction())
        } else {
            When::Announced(1 + dice.below(5), whole_s / 12.0 * dice.fraction())
        };
        let announced = kill_one(settings, at, &when);
        let kept = poses(&session).map_or(0, |p| p.len());
        lost += announced.saturating_sub(kept) as u64;
        by_done[kept.min(7)] += 1;
        if session.exists() && verify(&session).is_ok_and(|r| r.status == Status::Unreadable) {
            unreadable += 1;
        }
        // one that was killed before its head was written is begun anew
        let begun = session.exists() && Session::open(&session).is_ok();
        if !begun {
            let _ = std::fs::remove_file(&session);
        }
        if !run(settings, at, "s.mcap", begun) {
            failed += 1;
            continue;
        }
        let resumed = poses(&session).unwrap_or_default();
        let retaken = taken_again(&session);
        again += u64::from(!retaken.is_empty());
        if let Some((pose, what)) = difference(&resumed, &whole, &retaken) {
            unlike += 1;
            eprintln!("kill {n}, {kept} poses kept, taken again in poses {retaken:?}: pose {pose}: {what}");
        }
        if n % 50 == 0 && retaken.is_empty() {
            tables += 1;
            other_tables += u64::from(replay(settings, at, "s.mcap") != table);
        }
    }
    let size = format!("{} kills", grouped(kills));
    let spread: Vec<String> = by_done.iter().take(7).map(u64::to_string).collect();
    vec![
        Figure::exactly("poses announced as done and not in the file", lost, 0, &size),
        Figure::exactly("scans that could not go on", failed, 0, &size),
        Figure::exactly("sessions unreadable after the kill", unreadable, 0, &size),
        Figure::exactly("resumed sessions with any frame unlike the uninterrupted one's", unlike, 0, &size),
        Figure::exactly(
            "tables unlike the uninterrupted one's, byte for byte",
            other_tables,
            0,
            &format!("{tables} tables"),
        ),
        Figure::told("scans with a frame taken again, as their log tells", grouped(again), &size),
        Figure::told("kills with 0, 1, … 6 poses on the disk", spread.join(", "), &size),
    ]
}

/// The device in a process of its own.
fn device(settings: &Settings, at: &Path) -> Killed {
    let mut command = settings.command();
    command
        .args([
            "sim",
            "--instrument",
            "tiny",
            "--pty",
            "stage",
            "--camera-socket",
            "cam",
            "--truth",
            "paint.json",
        ])
        // a campaign that is killed itself leaves no device behind
        .args(["--time-scale", "200", "--with-parent"])
        .current_dir(at)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let device = Killed(command.spawn().expect("the virtual instrument starts"));
    let begun = Instant::now();
    while !(at.join("cam").exists() && at.join("stage").exists()) {
        assert!(begun.elapsed() < Duration::from_secs(60), "the virtual instrument is not there");
        std::thread::sleep(Duration::from_millis(10));
    }
    device
}

fn command(settings: &Settings, at: &Path, session: &str, resume: bool) -> std::process::Command {
    let mut command = settings.command();
    command
        .args([
            "-v",
            "scan",
            "--instrument",
            "tiny",
            "--device",
            "serial:stage",
            "--camera",
            "sim:cam",
            "-o",
            session,
        ])
        .args(resume.then_some("--resume"))
        .current_dir(at)
        .env("GONIO_RUNTIME_DIR", at.join("run"))
        .env_remove("GONIO_LOG")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

/// Runs a scan to its end; whether it ended well.
fn run(settings: &Settings, at: &Path, session: &str, resume: bool) -> bool {
    // the device may still be busy getting rid of the host before
    for _ in 0..5 {
        let done = command(settings, at, session, resume).output().expect("the program starts");
        if done.status.success() {
            return true;
        }
        eprintln!("{}", String::from_utf8_lossy(&done.stderr).lines().last().unwrap_or_default());
        std::thread::sleep(Duration::from_millis(500));
        if !resume {
            let _ = std::fs::remove_file(at.join(session));
        }
    }
    false
}

/// When a host is killed.
enum When {
    /// So many seconds after its start.
    After(f64),
    /// So many poses after its start, and then so many seconds.
    Announced(usize, f64),
}

/// Kills a scan; how many poses it had announced as done.
fn kill_one(settings: &Settings, at: &Path, when: &When) -> usize {
    let mut child = command(settings, at, "s.mcap", false).spawn().expect("the program starts");
    let stderr = child.stderr.take().expect("a pipe was asked for");
    let mut told = BufReader::new(stderr);
    let mut announced = 0;
    let is_done = |line: &str| line.contains(" done (");
    let after_s = match *when {
        When::After(after_s) => after_s,
        When::Announced(poses, after_s) => {
            let mut line = String::new();
            while announced < poses && told.read_line(&mut line).is_ok_and(|n| n > 0) {
                announced += usize::from(is_done(&line));
                line.clear();
            }
            after_s
        }
    };
    std::thread::sleep(Duration::from_secs_f64(after_s));
    let _ = child.kill();
    let mut rest = String::new();
    let _ = told.read_to_string(&mut rest);
    let _ = child.wait();
    announced + rest.lines().filter(|l| is_done(l)).count()
}

fn poses(path: &Path) -> Option<Vec<PoseRecord>> {
    Some(Session::open(path).ok()?.poses().flatten().collect())
}

/// Poses of a session of which the log tells that a frame was taken again.
fn taken_again(path: &Path) -> Vec<u32> {
    let Ok(session) = Session::open(path) else { return Vec::new() };
    let mut poses: Vec<u32> = session
        .events()
        .filter_map(|e| {
            let rest = e.text.split_once("a frame of pose ")?.1;
            rest.split_once(" is taken again")?.0.parse().ok()
        })
        .collect();
    poses.dedup();
    poses
}

/// The first thing that a result can depend on in which two sessions differ, and its pose; running numbers and the camera's clock are the run's own. Frames
/// may differ in poses of which one was taken again.
fn difference(resumed: &[PoseRecord], whole: &[PoseRecord], retaken: &[u32]) -> Option<(u32, String)> {
    if resumed.len() != whole.len() {
        return Some((0, format!("{} poses, {} uninterrupted", resumed.len(), whole.len())));
    }
    resumed.iter().zip(whole).find_map(|(a, b)| {
        let what = pose_difference(a, b, retaken.contains(&a.index))?;
        Some((a.index, what))
    })
}

fn pose_difference(a: &PoseRecord, b: &PoseRecord, retaken: bool) -> Option<String> {
    if (a.index, a.readback) != (b.index, b.readback) {
        return Some(format!("at {:?}, {} at {:?}", a.readback, b.index, b.readback));
    }
    if retaken {
        return None;
    }
    let taken =
        |p: &PoseRecord| p.exposures.iter().map(|e| (e.frame.exposure, e.shutter_open)).collect::<Vec<_>>();
    if taken(a) != taken(b) {
        return Some(format!("exposures {:?}, uninterrupted {:?}", taken(a), taken(b)));
    }
    for (k, (a_k, b_k)) in a.exposures.iter().zip(&b.exposures).enumerate() {
        if a_k.frame.pixels != b_k.frame.pixels {
            let others = a_k.frame.pixels.iter().zip(&b_k.frame.pixels).filter(|(a, b)| a != b).count();
            let like = b.exposures.iter().position(|e| e.frame.pixels == a_k.frame.pixels);
            return Some(format!(
                "exposure {k} of {:?}, shutter {}: {others} pixels differ, like exposure {like:?}",
                a_k.frame.exposure,
                if a_k.shutter_open { "open" } else { "closed" },
            ));
        }
        if a_k.lamp_monitor.to_bits() != b_k.lamp_monitor.to_bits() {
            let (a_m, b_m) = (a_k.lamp_monitor, b_k.lamp_monitor);
            return Some(format!("exposure {k}: lamp monitor {a_m}, uninterrupted {b_m}"));
        }
    }
    None
}

/// The table of a session, by a white reference of the virtual instrument that is taken once.
fn replay(settings: &Settings, at: &Path, session: &str) -> Option<Vec<u8>> {
    let white = at.join("white.mcap");
    let quiet = |words: &[&str]| {
        let mut command = settings.command();
        command.args(words).current_dir(at).stdout(Stdio::null()).stderr(Stdio::null()).stdin(Stdio::null());
        command.status().is_ok_and(|s| s.success())
    };
    if !white.exists() && !quiet(&["scan", "--instrument", "tiny", "--kind", "white", "-o", "white.mcap"]) {
        return None;
    }
    let table = at.join("t.nc");
    let _ = std::fs::remove_file(&table);
    quiet(&["replay", session, "--reference", "white.mcap", "-o", "t.nc"])
        .then(|| std::fs::read(table).ok())?
}
