//! Damage to a session file: never a wrong frame, and never a flipped bit that `verify` does not report.
//!
//! The session is small, so that every offset can be cut and every bit flipped: four poses of three frames of noise. Cut at each offset, what is
//! returned must be what was written, and all that lies before the cut whole should be. Of the flips, half are single bits, half are two to
//! eight in one file.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::FileExt as _;
use std::path::Path;
use std::time::Duration;

use gonio_instrument::{Exposure, Frame, Pose, PoseRecord, SampleRecord, builtin};
use gonio_recording::{Clock, Header, RecordingError, Session, Status, Writer, WriterOptions, verify};

use super::dice::Dice;
use super::{Figure, Settings, grouped};

const FLIPS: u64 = 100_000;
const POSES: u32 = 4;
const FRAMES: u32 = 3;

/// Writes the session; what went in, and where the first pose begins and each ends in the file.
pub(super) fn write(path: &Path, seed: u64) -> (Vec<PoseRecord>, Vec<u64>) {
    let instrument = builtin::description("tiny").expect("built in").expect("readable");
    let plan = instrument.plan.clone();
    let clock = Clock::Steps { start: Duration::from_secs(1_000), step: Duration::from_millis(1) };
    let options = WriterOptions { clock, ..WriterOptions::default() };
    let header = Header::new(instrument, plan, SampleRecord::default());
    let mut writer = Writer::create(path, &header, options).expect("created");
    let mut dice = Dice::new(seed, 0);
    let head = std::fs::metadata(path).expect("durable").len();
    let (mut poses, mut ends) = (Vec::new(), vec![head]);
    for index in 0..POSES {
        let commanded = Pose::from_degrees(f64::from(index) * 10.0, 0.0);
        let mut record = PoseRecord { index, commanded, readback: commanded, exposures: Vec::new() };
        writer.begin_pose(index, commanded, commanded).expect("begun");
        for n in 0..FRAMES {
            let frame = Frame {
                width: 8,
                height: 6,
                pixels: (0..48).map(|_| (dice.next_u64() & 0xfff) as u16).collect(),
                exposure: Duration::from_micros(20 << n),
                sequence: u64::from(index * FRAMES + n),
                stamp: Duration::from_millis(u64::from(n)),
                sensor_temperature_c: Some(31.5),
            };
            let exposure = Exposure { frame, lamp_monitor: 1.0, shutter_open: n > 0 };
            writer.frame(&exposure).expect("taken");
            record.exposures.push(exposure);
        }
        ends.push(writer.end_pose().expect("done"));
        poses.push(record);
    }
    writer.finish().expect("finished");
    (poses, ends)
}

#[derive(Default)]
struct Tally {
    files: u64,
    wrong: u64,
    unreported: u64,
    returned: u64,
    /// Frames of poses that the damage did not touch, and of these those that came out.
    good: u64,
    good_returned: u64,
    refused: u64,
}

impl Tally {
    /// Reads what is left; the poses of `good` ought to be there.
    fn look(&mut self, path: &Path, wanted: &[PoseRecord], good: &[u32]) {
        self.files += 1;
        self.good += good.len() as u64 * u64::from(FRAMES);
        let Ok(session) = Session::open(path) else { return };
        for pose in session.poses().flatten() {
            let true_one = wanted.contains(&pose);
            self.wrong += if true_one { 0 } else { pose.exposures.len() as u64 };
            let frames = if true_one { pose.exposures.len() as u64 } else { 0 };
            self.returned += frames;
            self.good_returned += if good.contains(&pose.index) { frames } else { 0 };
        }
        session.notes().for_each(drop);
    }

    fn verified(&mut self, path: &Path) {
        match verify(path) {
            Ok(report) => self.unreported += u64::from(report.status == Status::Intact),
            Err(RecordingError::NotASession { .. } | RecordingError::Version { .. }) => self.refused += 1,
            Err(_) => {}
        }
    }
}

/// Runs the campaign.
///
/// # Panics
/// Where the temporary folder cannot be written.
#[must_use]
pub fn figures(settings: &Settings) -> Vec<Figure> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("s.mcap");
    let (wanted, ends) = write(&path, settings.seed);
    let length = std::fs::metadata(&path).expect("there").len();
    let cuts =
        cut_everywhere(folder.path(), &path, &wanted, &ends, if settings.share < 1.0 { 29 } else { 1 });
    let flips = flip(&path, &wanted, &ends, settings.count(FLIPS, 500), settings.seed);
    let size_of_cuts = format!("{} offsets of {} bytes", grouped(cuts.files), grouped(length));
    let size_of_flips = format!("{} damaged files", grouped(flips.files));
    let percent = |part: u64, whole: u64| format!("{:.2} %", 100.0 * part as f64 / whole.max(1) as f64);
    vec![
        Figure::exactly("wrong frames returned after a cut", cuts.wrong, 0, &size_of_cuts),
        Figure::exactly("cuts unreported by verify", cuts.unreported, 0, &size_of_cuts),
        Figure::exactly(
            "whole frames before the cut that are not returned",
            cuts.good - cuts.good_returned,
            0,
            &size_of_cuts,
        ),
        Figure::exactly("wrong frames returned after flips", flips.wrong, 0, &size_of_flips),
        Figure::exactly("flips unreported by verify", flips.unreported, 0, &size_of_flips),
        Figure::exactly(
            "frames of poses that no flip hit, not returned",
            flips.good - flips.good_returned,
            0,
            &size_of_flips,
        ),
        Figure::told(
            "share of the good frames returned after flips",
            percent(flips.good_returned, flips.good),
            &size_of_flips,
        ),
        Figure::told(
            "share of all frames returned after flips",
            percent(flips.returned, flips.files * u64::from(POSES * FRAMES)),
            &size_of_flips,
        ),
        Figure::told("files refused whole after flips", grouped(flips.refused), &size_of_flips),
    ]
}

/// Every `step`-th offset.
fn cut_everywhere(folder: &Path, path: &Path, wanted: &[PoseRecord], ends: &[u64], step: usize) -> Tally {
    let bytes = std::fs::read(path).expect("readable");
    let cut = folder.join("cut.mcap");
    let mut tally = Tally::default();
    for at in (0..bytes.len()).step_by(step) {
        std::fs::write(&cut, &bytes[..at]).expect("written");
        let whole = ends.iter().skip(1).zip(0..).filter(|(end, _)| at as u64 >= **end);
        let whole: Vec<u32> = whole.map(|(_, index)| index).collect();
        tally.look(&cut, wanted, &whole);
        tally.verified(&cut);
    }
    tally
}

fn flip(path: &Path, wanted: &[PoseRecord], ends: &[u64], flips: u64, seed: u64) -> Tally {
    let file = OpenOptions::new().read(true).write(true).open(path).expect("opens");
    let bits = std::fs::metadata(path).expect("there").len() as usize * 8;
    let mut dice = Dice::new(seed, 1);
    let mut tally = Tally::default();
    for n in 0..flips {
        let count = if n % 2 == 0 { 1 } else { 2 + dice.below(7) };
        // the same bit twice would be none
        let places: BTreeMap<usize, ()> = (0..count).map(|_| (dice.below(bits), ())).collect();
        for &bit in places.keys() {
            toggle(&file, bit);
        }
        let hit = |from: u64, to: u64| places.keys().any(|&bit| (from..to).contains(&(bit as u64 / 8)));
        let good = ends.windows(2).zip(0..).filter(|(pose, _)| !hit(pose[0], pose[1]));
        let good: Vec<u32> = good.map(|(_, index)| index).collect();
        tally.look(path, wanted, &good);
        tally.verified(path);
        for &bit in places.keys() {
            toggle(&file, bit);
        }
    }
    tally
}

fn toggle(file: &File, bit: usize) {
    let mut byte = [0];
    file.read_exact_at(&mut byte, bit as u64 / 8).expect("readable");
    file.write_all_at(&[byte[0] ^ (1 << (bit % 8))], bit as u64 / 8).expect("writable");
}
