//! Sessions that were stopped and continued, and those that break off.

mod made;

use std::collections::BTreeSet;

use gonio_recording::paths::segment_path;
use gonio_recording::{
    Clock, RecordingError, Session, Status, Writer, WriterOptions, info, progress, replay, resume, verify,
};
use made::{exposure, fill, header, options, pose, write};

fn clock() -> Clock {
    options().clock
}

#[test]
fn a_session_that_broke_off_is_finished_and_continued_in_a_second_file() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let h = header();
    let mut w = Writer::create(&path, &h, options()).expect("created");
    let mut wanted = fill(&mut w, 16, 8, 0..3);
    w.begin_pose(3, pose(3), pose(3)).expect("begun");
    w.frame(&exposure(16, 8, 3, 0)).expect("taken");
    w.abandon();
    // part of a chunk reached the disk
    let mut bytes = std::fs::read(&path).expect("readable");
    bytes.extend_from_slice(&[6, 0, 0, 1, 0, 0, 0, 0, 0, 77, 78]);
    std::fs::write(&path, &bytes).expect("written");
    assert_eq!(verify(&path).expect("readable").status, Status::ReadableWithLoss);

    let (mut w, p) = resume(&path, &h, clock()).expect("continues");
    assert_eq!(p.done, BTreeSet::from([0, 1, 2]));
    assert_eq!((p.planned, p.complete()), (Some(12), false));
    assert_eq!((w.segment(), w.path().to_owned()), (2, segment_path(&path, 2)));
    wanted.extend(fill(&mut w, 16, 8, 3..12));
    w.finish().expect("finished");

    let r = verify(&path).expect("readable");
    assert_eq!((r.status, r.findings.as_slice(), r.finished), (Status::Intact, &[][..], true));
    let got: Vec<_> = Session::open(&path).expect("opens").poses().collect::<Result<_, _>>().expect("whole");
    assert_eq!(got, wanted);
    assert!(progress(&path).expect("readable").complete());
    let i = info(&path).expect("readable");
    assert!(i.complete && i.finished && i.damage.is_empty());
    assert_eq!((i.files.len(), i.poses.len(), i.frames), (2, 12, 36));
    // MCAP's own reader takes the file that was finished in place
    let bytes = std::fs::read(&path).expect("readable");
    let images = mcap::MessageStream::new(&bytes)
        .expect("opens")
        .map(|m| m.expect("readable"))
        .filter(|m| m.channel.topic == "/camera/raw")
        .count();
    assert_eq!(images, 9);
    let summary = mcap::Summary::read(&bytes).expect("readable").expect("there");
    assert_eq!(summary.chunk_indexes.len(), 3);
    for c in &summary.chunk_indexes {
        assert!(!summary.read_message_indexes(&bytes, c).expect("indexed").is_empty());
    }
}

#[test]
fn a_damaged_pose_is_taken_again_and_the_whole_one_counts() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let h = header();
    let wanted = write(&path, &h, 16, 8, 3);
    let mut bytes = std::fs::read(&path).expect("readable");
    let second = (0..bytes.len()).filter(|&i| bytes[i..].starts_with(&[0x28, 0xb5, 0x2f, 0xfd])).nth(1);
    bytes[second.expect("a second zstd frame") + 1000] ^= 4;
    std::fs::write(&path, &bytes).expect("written");
    let (mut w, p) = resume(&path, &h, clock()).expect("continues");
    assert_eq!((p.done, p.damaged), (BTreeSet::from([0, 2]), BTreeSet::from([1])));
    fill(&mut w, 16, 8, 1..2);
    w.finish().expect("finished");
    let r = verify(&path).expect("readable");
    assert_eq!((r.status, r.poses, r.lost), (Status::ReadableWithLoss, vec![0, 1, 2], vec![]));
    let got: Vec<_> = Session::open(&path).expect("opens").poses().collect::<Result<_, _>>().expect("whole");
    assert_eq!(got, wanted);
}

#[test]
fn another_scan_is_not_continued_and_a_running_one_not_disturbed() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let h = header();
    let mut w = Writer::create(&path, &h, options()).expect("created");
    fill(&mut w, 8, 8, 0..1);
    assert_eq!(
        resume(&path, &h, clock()).expect_err("running"),
        RecordingError::InUse { path: path.clone() }
    );
    let force = WriterOptions { overwrite: true, ..options() };
    assert_eq!(
        Writer::create(&path, &h, force).expect_err("running"),
        RecordingError::InUse { path: path.clone() }
    );
    w.finish().expect("finished");
    let mut other = header();
    other.plan.spin_deg = vec![0.0];
    let e = resume(&path, &other, clock()).expect_err("another plan");
    assert_eq!(e, RecordingError::Mismatch { path: path.clone(), what: "plan" });
    assert_eq!(Session::open(&path).expect("opens").pose_indices().count(), 1);
    assert!(!segment_path(&path, 2).exists());
}

#[test]
fn a_missing_or_foreign_segment_is_reported() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let h = header();
    write(&path, &h, 8, 8, 1);
    for _ in 0..2 {
        resume(&path, &h, clock()).expect("continues").0.finish().expect("finished");
    }
    assert_eq!(verify(&path).expect("readable").status, Status::Intact);
    std::fs::remove_file(segment_path(&path, 2)).expect("removed");
    let r = verify(&path).expect("readable");
    assert_eq!(r.status, Status::ReadableWithLoss);
    assert!(r.findings.iter().any(|f| f.what.contains("segment 2 is missing")), "{:#?}", r.findings);
    let mut late = options();
    late.clock =
        Clock::Steps { start: std::time::Duration::from_secs(1), step: std::time::Duration::from_secs(1) };
    Writer::create(&dir.path().join("o.mcap"), &h, late).expect("created").finish().expect("finished");
    std::fs::rename(dir.path().join("o.mcap"), segment_path(&path, 2)).expect("moved");
    let r = verify(&path).expect("readable");
    assert!(r.findings.iter().any(|f| f.what.contains("belongs to session")), "{:#?}", r.findings);
}

#[test]
fn a_replay_runs_over_all_segments() {
    use gonio_instrument::{Cancel, Stage as _};
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let h = header();
    write(&path, &h, 8, 8, 2);
    let (mut w, _) = resume(&path, &h, clock()).expect("continues");
    fill(&mut w, 8, 8, 2..4);
    w.finish().expect("finished");
    let (mut stage, _) = replay::replay(Session::open(&path).expect("opens")).expect("replays");
    for i in [0, 3, 1, 2] {
        stage.move_to(pose(i), &Cancel::new()).expect("recorded");
    }
}
