//! Sessions made for tests: small, noisy, the same every time.
#![allow(dead_code)] // each test binary uses a part of it

use std::path::Path;
use std::time::Duration;

use gonio_instrument::{
    CameraInfo, Certificate, Exposure, Frame, Plan, Pose, PoseRecord, SampleRecord, ScanKind, StageIdentity,
    builtin,
};
use gonio_recording::{Attachment, Clock, Devices, Direction, Header, Level, Writer, WriterOptions};

/// A clock that is the same every time.
pub fn options() -> WriterOptions {
    let clock = Clock::Steps { start: Duration::from_secs(1_700_000_000), step: Duration::from_millis(7) };
    WriterOptions { clock, ..WriterOptions::default() }
}

/// A header with every part.
pub fn header() -> Header {
    let instrument = builtin::description("tiny").expect("built in").expect("readable");
    let plan = Plan { spin_deg: vec![0.0, 33.3], ..instrument.plan.clone() };
    let sample = SampleRecord {
        kind: ScanKind::White,
        name: "a \"white\" tile, 2 µm".to_owned(),
        ..SampleRecord::default()
    };
    let mut h = Header::new(instrument, plan, sample);
    // 1/3 does not end in decimals: the numbers must come back bit for bit all the same
    h.certificate = Some(Certificate { relative_uncertainty: 1.0 / 3.0, ..Certificate::virtual_white() });
    h.devices = Devices {
        stage: StageIdentity { name: "stage".to_owned(), serial: "7".to_owned(), ..StageIdentity::default() },
        camera: CameraInfo {
            name: "camera".to_owned(),
            width: 160,
            height: 128,
            bits: 12,
            ..CameraInfo::default()
        },
    };
    h.provenance.insert("seed".to_owned(), "1".to_owned());
    h.attachments.push(Attachment::text("truth.json", "application/json", "{\"model\":\"lambert\"}"));
    h
}

/// The `i`-th pose of a plan, at an angle that has no short decimal form.
pub fn pose(i: u32) -> Pose {
    Pose::from_radians(f64::from(i) * 0.1 + 1.0 / 3.0, f64::from(i) / 7.0)
}

/// A noisy 12-bit frame that depends on pose and number alone.
pub fn exposure(width: u32, height: u32, pose: u32, number: u32) -> Exposure {
    let mut x = u64::from(pose) << 32 | u64::from(number) | 1 << 60;
    let pixels = (0..width * height)
        .map(|_| {
            x ^= x << 13;
            x ^= x >> 7;
            x ^= x << 17;
            (64 + (x >> 58) * u64::from(number + 1)) as u16 & 0xfff
        })
        .collect();
    Exposure {
        frame: Frame {
            width,
            height,
            pixels,
            exposure: Duration::from_nanos(20_000 << (2 * number)),
            sequence: u64::from(pose * 10 + number),
            stamp: Duration::from_millis(u64::from(pose * 100 + number * 3)),
            sensor_temperature_c: number.is_multiple_of(2).then_some(21.7 + f64::from(number) / 3.0),
        },
        lamp_monitor: 1.0 + f64::from(pose) / 300.0 + f64::from(number) / 7000.0,
        shutter_open: number % 3 != 2,
    }
}

/// Writes a finished session of `poses` poses with three frames each; returns what was written.
pub fn write(path: &Path, header: &Header, width: u32, height: u32, poses: u32) -> Vec<PoseRecord> {
    let mut w = Writer::create(path, header, options()).expect("created");
    let records = fill(&mut w, width, height, 0..poses);
    w.finish().expect("finished");
    records
}

/// Records poses with an event and a few bytes on the wire.
pub fn fill(w: &mut Writer, width: u32, height: u32, poses: std::ops::Range<u32>) -> Vec<PoseRecord> {
    let t = w.time();
    w.event(t, Level::Info, "begun").expect("noted");
    let mut records = Vec::new();
    for i in poses {
        let direction = if i % 2 == 1 { Direction::FromDevice } else { Direction::ToDevice };
        let t = w.time();
        w.wire(direction, t, &[i as u8, 0, 255]).expect("noted");
        let record = PoseRecord {
            index: i,
            commanded: pose(i),
            readback: Pose::from_radians(pose(i).tilt.radians() + 1e-5, pose(i).spin.radians()),
            exposures: (0..3).map(|n| exposure(width, height, i, n)).collect(),
        };
        w.begin_pose(i, record.commanded, record.readback).expect("begun");
        for e in &record.exposures {
            w.frame(e).expect("taken");
        }
        let t = w.time();
        w.event(t, Level::Warning, "µ").expect("noted");
        assert!(w.end_pose().expect("done") > 0);
        records.push(record);
    }
    records
}
