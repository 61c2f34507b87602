//! What is left of a session after truncation and flipped bits: never a panic, never a wrong value, always a report.

mod made;

use std::fs::{File, OpenOptions};
use std::os::unix::fs::FileExt as _;
use std::path::Path;

use gonio_instrument::PoseRecord;
use gonio_recording::{Header, RecordingError, Session, Status, Writer, recover, resume, verify};
use made::{exposure, header, options, pose, write};
use proptest::prelude::*;

/// Every pose that comes out is one of those that went in, and is in its place.
fn only_true_poses(path: &Path, wanted: &[PoseRecord]) -> usize {
    let Ok(s) = Session::open(path) else { return 0 };
    let good: Vec<_> = s.poses().filter_map(Result::ok).collect();
    for p in &good {
        assert_eq!(p, &wanted[p.index as usize]);
    }
    s.notes().for_each(drop);
    good.len()
}

/// Offset of every record outside chunks, from the bytes alone.
fn record_boundaries(bytes: &[u8]) -> Vec<usize> {
    let (mut at, mut all) = (8, vec![0, 8]);
    while at + 9 <= bytes.len() - 8 {
        let n = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("eight bytes"));
        at += 9 + n as usize;
        all.push(at);
    }
    all
}

fn flip(file: &File, byte: u64, mask: u8) {
    let mut b = [0];
    file.read_exact_at(&mut b, byte).expect("readable");
    file.write_all_at(&[b[0] ^ mask], byte).expect("writable");
}

/// Flips every bit of `path` in `bytes`, one at a time; each must change what `verify` says.
fn every_flip_is_reported(path: &Path, wanted: &[PoseRecord], bytes: std::ops::Range<u64>) {
    let whole = verify(path).expect("readable");
    let file = OpenOptions::new().read(true).write(true).open(path).expect("opens");
    for bit in bytes.start * 8..bytes.end * 8 {
        let (byte, mask) = (bit / 8, 1 << (bit % 8));
        flip(&file, byte, mask);
        match verify(path) {
            Ok(r) => {
                assert_ne!(r.status, Status::Intact, "byte {byte}, mask {mask:#04x}");
                assert_ne!(r.findings, whole.findings, "byte {byte}, mask {mask:#04x}");
                for l in r.poses {
                    assert!(wanted.iter().any(|p| p.index == l));
                }
            }
            Err(RecordingError::NotASession { .. } | RecordingError::Version { .. }) => {}
            Err(e) => panic!("byte {byte}, mask {mask:#04x}: {e}"),
        }
        only_true_poses(path, wanted);
        flip(&file, byte, mask);
    }
    assert_eq!(verify(path).expect("readable"), whole, "the file is as it was");
}

fn smallest_header() -> Header {
    let mut h = header();
    h.attachments.clear();
    h.certificate = None;
    h
}

/// A session as small as they come: what is long in the header does not make the test better.
fn smallest(path: &Path, finished: bool) -> Vec<PoseRecord> {
    let mut w = Writer::create(path, &smallest_header(), options()).expect("created");
    let mut records = Vec::new();
    for i in 0..2 {
        let record = PoseRecord {
            index: i,
            commanded: pose(i),
            readback: pose(i),
            exposures: vec![exposure(8, 8, i, 0)],
        };
        w.begin_pose(i, record.commanded, record.readback).expect("begun");
        w.frame(&record.exposures[0]).expect("taken");
        w.end_pose().expect("done");
        records.push(record);
    }
    if finished {
        w.finish().expect("finished");
    } else {
        w.abandon();
    }
    records
}

#[test]
fn every_flipped_bit_of_a_finished_session_is_reported() {
    let dir = tempfile::tempdir().expect("a folder");
    // halves of the file side by side
    std::thread::scope(|scope| {
        for half in 0..2 {
            let path = dir.path().join(format!("{half}.mcap"));
            scope.spawn(move || {
                let wanted = smallest(&path, true);
                assert_eq!(verify(&path).expect("readable").status, Status::Intact);
                let n = std::fs::metadata(&path).expect("there").len();
                every_flip_is_reported(&path, &wanted, n * half / 2..n * (half + 1) / 2);
            });
        }
    });
}

#[test]
fn every_flipped_bit_of_an_unfinished_session_is_reported() {
    let dir = tempfile::tempdir().expect("a folder");
    std::thread::scope(|scope| {
        for half in 0..2 {
            let path = dir.path().join(format!("{half}.mcap"));
            scope.spawn(move || {
                let wanted = smallest(&path, false);
                let r = verify(&path).expect("readable");
                assert_eq!((r.status, r.poses.len()), (Status::ReadableWithLoss, 2));
                let n = std::fs::metadata(&path).expect("there").len();
                every_flip_is_reported(&path, &wanted, n * half / 2..n * (half + 1) / 2);
            });
        }
    });
}

#[test]
fn one_flipped_bit_costs_one_pose_at_most() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    let wanted = smallest(&path, true);
    let head = {
        let bytes = std::fs::read(&path).expect("readable");
        let chunk = record_boundaries(&bytes).into_iter().find(|&at| bytes[at] == 6);
        chunk.expect("a chunk") as u64
    };
    let file = OpenOptions::new().read(true).write(true).open(&path).expect("opens");
    for byte in (0..std::fs::metadata(&path).expect("there").len()).step_by(3) {
        for mask in [1, 128] {
            flip(&file, byte, mask);
            let left = only_true_poses(&path, &wanted);
            assert!(left >= 1, "byte {byte}, mask {mask:#04x}: {left} poses left");
            assert!(byte >= head || left == 2, "byte {byte} of the head cost a pose");
            flip(&file, byte, mask);
        }
    }
}

#[test]
fn truncation_at_every_record_and_beside_it_loses_only_what_is_cut() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("whole.mcap");
    let wanted = write(&path, &header(), 16, 8, 4);
    let bytes = std::fs::read(&path).expect("readable");
    let cut = dir.path().join("cut.mcap");
    let mut seen = std::collections::BTreeSet::new();
    for boundary in record_boundaries(&bytes) {
        for at in boundary.saturating_sub(1)..=(boundary + 1).min(bytes.len()) {
            std::fs::write(&cut, &bytes[..at]).expect("written");
            seen.insert(only_true_poses(&cut, &wanted));
            match verify(&cut) {
                Ok(r) => assert_eq!(r.status == Status::Intact, at == bytes.len(), "cut at {at}"),
                Err(RecordingError::NotASession { .. }) => assert!(at < 9000, "cut at {at}"),
                Err(e) => panic!("cut at {at}: {e}"),
            }
        }
    }
    assert_eq!(seen.into_iter().collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
}

#[test]
fn a_damaged_session_is_recovered_without_the_damage() {
    let dir = tempfile::tempdir().expect("a folder");
    let (path, out) = (dir.path().join("s.mcap"), dir.path().join("t.mcap"));
    let wanted = write(&path, &header(), 16, 8, 4);
    let bytes = std::fs::read(&path).expect("readable");
    let chunk =
        record_boundaries(&bytes).into_iter().filter(|&at| bytes[at] == 6).nth(1).expect("a second chunk");
    // in the length of the chunk's record: the stock reader loses all that follows
    let file = OpenOptions::new().read(true).write(true).open(&path).expect("opens");
    flip(&file, chunk as u64 + 5, 0x40);
    // and in the pixels of the third
    let third =
        record_boundaries(&bytes).into_iter().filter(|&at| bytes[at] == 6).nth(2).expect("a third chunk");
    flip(&file, third as u64 + 900, 1);
    let r = recover(&path, &out, false).expect("recovered");
    assert_eq!(r.lost.iter().map(|l| l.index).collect::<Vec<_>>(), [2], "{r:#?}");
    assert_eq!(r.poses, [0, 1, 3], "a seal finds the chunk whose length is damaged");
    assert_eq!(verify(&out).expect("readable").status, Status::Intact);
    let s = Session::open(&out).expect("opens");
    assert_eq!(s.sample().expect("kept"), header().sample);
    let got: Vec<_> = s.poses().collect::<Result<_, _>>().expect("whole");
    assert_eq!(got, [wanted[0].clone(), wanted[1].clone(), wanted[3].clone()]);
    assert!(s.attachment("recovery.json").is_some());
    assert!(matches!(recover(&path, &out, false), Err(RecordingError::Exists { .. })));
    assert!(matches!(recover(&path, &path, true), Err(RecordingError::Exists { .. })), "never onto itself");
}

#[test]
fn a_damaged_attachment_hides_no_other() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    write(&path, &header(), 8, 8, 1);
    let bytes = std::fs::read(&path).expect("readable");
    let first = record_boundaries(&bytes).into_iter().find(|&at| bytes[at] == 9).expect("an attachment");
    let file = OpenOptions::new().read(true).write(true).open(&path).expect("opens");
    flip(&file, first as u64 + 2, 2);
    let s = Session::open(&path).expect("opens");
    assert_eq!(s.header().expect("all of it"), header());
    assert_eq!(verify(&path).expect("readable").status, Status::ReadableWithLoss);
}

#[test]
fn a_foreign_file_is_refused_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("s.mcap");
    for text in [&b""[..], b"PK\x03\x04 not one of ours", &[0x89, b'M', b'C', b'A', b'P', 0x30, b'\r', b'\n']]
    {
        std::fs::write(&path, text).expect("written");
        assert!(matches!(Session::open(&path), Err(RecordingError::NotASession { .. })));
    }
    assert!(matches!(Session::open(dir.path()), Err(RecordingError::NotASession { .. })));
    assert!(matches!(Session::open(&dir.path().join("no.mcap")), Err(RecordingError::Absent { .. })));
    // written by another program
    let mut w = mcap::Writer::new(File::create(&path).expect("created")).expect("begun");
    w.finish().expect("finished");
    let e = Session::open(&path).expect_err("foreign").to_string();
    assert!(e.contains("is not a gonio session"), "{e}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn random_damage_never_panics_and_never_lies(
        cut in 0.0..1.0f64,
        hits in prop::collection::vec((0.0..1.0f64, any::<u8>()), 0..8),
        hole in prop::option::of((0.0..1.0f64, 1usize..400)),
    ) {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("s.mcap");
        let wanted = smallest(&path, true);
        let mut bytes = std::fs::read(&path).expect("readable");
        let n = bytes.len();
        let at = |f: f64| ((f * n as f64) as usize).min(n - 1);
        for (place, value) in hits {
            bytes[at(place)] = value;
        }
        if let Some((place, length)) = hole {
            let from = at(place);
            bytes.drain(from..(from + length).min(n));
        }
        let keep = bytes.len().min(at(cut.sqrt()) + 1);
        bytes.truncate(keep);
        std::fs::write(&path, &bytes).expect("written");
        only_true_poses(&path, &wanted);
        let _ = verify(&path);
        let out = dir.path().join("t.mcap");
        if recover(&path, &out, false).is_ok() {
            prop_assert_eq!(verify(&out).expect("readable").findings.iter().filter(|f| !f.what.ends_with("is lost")).count(), 0);
            only_true_poses(&out, &wanted);
        }
        let before = only_true_poses(&path, &wanted);
        if let Ok((w, p)) = resume(&path, &smallest_header(), options().clock) {
            prop_assert_eq!(p.done.len(), before);
            w.finish().expect("finished");
            prop_assert_eq!(only_true_poses(&path, &wanted), before, "what was measured is kept");
        }
    }
}
