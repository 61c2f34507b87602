//! Writing and reading frames of 1280 × 1024, against a plain write and read of the same bytes (`raw-file`) with the same `sync_data`.
//!
//! `cargo bench -p gonio-recording`; the last lines give the ratios.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::time::{Duration, Instant};

use criterion::{BatchSize, Criterion, Throughput};
use gonio_instrument::{Exposure, Frame, Plan, Pose, SampleRecord, builtin};
use gonio_recording::{Header, Session, Writer, WriterOptions, verify};

const WIDTH: u32 = 1280;
const HEIGHT: u32 = 1024;
/// One pose: a bracket of six exposures, dark to bright.
const FRAMES: u32 = 6;
const POSES: u32 = 2;

/// A glossy peak over a dim field with shot and read noise of the reference camera (2.48 electrons a count, 3 e read noise).
fn frame(number: u32) -> Exposure {
    let mut x = 0x9e37_79b9_7f4a_7c15u64 ^ u64::from(number) << 7;
    let mut uniform = || {
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        (x >> 40) as f64 / f64::from(1u32 << 24)
    };
    let gain = f64::from(1u32 << (2 * number));
    let pixels = (0..WIDTH * HEIGHT)
        .map(|i| {
            let (column, row) = (f64::from(i % WIDTH), f64::from(i / WIDTH));
            let d = (column - 700.0).hypot(row - 400.0);
            let electrons = gain * (5.0 + 200.0 * (-d / 60.0).exp() + 4.0 * d / 900.0);
            // a sum of four uniforms stands for a normal deviate
            let normal = ((0..4).map(|_| uniform()).sum::<f64>() - 2.0) * 3f64.sqrt();
            let counts = 64.0 + (electrons + (electrons + 9.0).sqrt() * normal) / 2.48;
            counts.round().clamp(0.0, 4095.0) as u16
        })
        .collect();
    Exposure {
        frame: Frame {
            width: WIDTH,
            height: HEIGHT,
            pixels,
            exposure: Duration::from_micros(20 << (2 * number)),
            sequence: u64::from(number),
            stamp: Duration::from_millis(u64::from(number)),
            sensor_temperature_c: None,
        },
        lamp_monitor: 1.0,
        shutter_open: true,
    }
}

fn header() -> Header {
    let instrument = builtin::description("reference").expect("built in").expect("readable");
    let plan: Plan = instrument.plan.clone();
    Header::new(instrument, plan, SampleRecord::default())
}

fn raw_file(path: &Path, frames: &[Exposure]) {
    let mut f = File::create(path).expect("created");
    for _ in 0..POSES {
        for e in frames {
            let bytes: Vec<u8> = e.frame.pixels.iter().flat_map(|p| p.to_le_bytes()).collect();
            f.write_all(&bytes).expect("written");
        }
        f.sync_data().expect("synced");
    }
}

fn journal(path: &Path, header: &Header, frames: &[Exposure]) {
    let options = WriterOptions { overwrite: true, ..WriterOptions::default() };
    let mut w = Writer::create(path, header, options).expect("created");
    for i in 0..POSES {
        w.begin_pose(i, Pose::default(), Pose::default()).expect("begun");
        for e in frames {
            w.frame(e).expect("taken");
        }
        w.end_pose().expect("done");
    }
    w.finish().expect("finished");
}

/// Size and time of the same images through MCAP's stock writer with another compression.
fn stock(compression: Option<mcap::Compression>, frames: &[Exposure]) -> (usize, f64) {
    let messages: Vec<Vec<u8>> =
        frames.iter().map(|e| e.frame.pixels.iter().flat_map(|p| p.to_le_bytes()).collect()).collect();
    let start = Instant::now();
    let mut out = std::io::Cursor::new(Vec::new());
    let options =
        mcap::WriteOptions::new().compression(compression).compression_level(1).compression_threads(0);
    let mut w = options.chunk_size(None).create(&mut out).expect("begun");
    let channel = w.add_channel(0, "/raw", "", &Default::default()).expect("added");
    for data in &messages {
        let header =
            mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
        w.write_to_known_channel(&header, data).expect("written");
    }
    w.finish().expect("finished");
    drop(w);
    (out.into_inner().len(), start.elapsed().as_secs_f64())
}

/// Median of five runs.
fn median(mut run: impl FnMut()) -> f64 {
    let mut t: Vec<f64> = (0..5)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64()
        })
        .collect();
    t.sort_by(f64::total_cmp);
    t[2]
}

#[allow(clippy::print_stdout)] // a benchmark's result
fn main() {
    let dir = tempfile::tempdir().expect("a folder");
    let (raw, session) = (dir.path().join("raw"), dir.path().join("s.mcap"));
    let frames: Vec<_> = (0..FRAMES).map(frame).collect();
    let header = header();
    let bytes = u64::from(WIDTH * HEIGHT * 2 * FRAMES * POSES);

    let mut c = Criterion::default().configure_from_args().sample_size(10);
    let mut g = c.benchmark_group("session");
    g.throughput(Throughput::Bytes(bytes));
    g.bench_function("write/raw-file", |b| b.iter(|| raw_file(&raw, &frames)));
    g.bench_function("write/journal", |b| b.iter(|| journal(&session, &header, &frames)));
    g.bench_function("read/raw-file", |b| {
        b.iter_batched(
            || File::open(&raw).expect("opens"),
            |mut f| {
                let mut v = Vec::new();
                f.read_to_end(&mut v).expect("read")
            },
            BatchSize::PerIteration,
        );
    });
    g.bench_function("read/poses", |b| b.iter(|| Session::open(&session).expect("opens").poses().count()));
    g.bench_function("read/verify", |b| b.iter(|| verify(&session).expect("readable")));
    g.finish();

    raw_file(&raw, &frames);
    journal(&session, &header, &frames);
    let size = std::fs::metadata(&session).expect("there").len();
    let base = median(|| raw_file(&raw, &frames));
    let ours = median(|| journal(&session, &header, &frames));
    let caller = {
        // what a frame costs the scan: the call alone, with the thread idle before it
        let options = WriterOptions { overwrite: true, ..WriterOptions::default() };
        let mut w = Writer::create(&session, &header, options).expect("created");
        w.begin_pose(0, Pose::default(), Pose::default()).expect("begun");
        let start = Instant::now();
        w.frame(&frames[0]).expect("taken");
        let t = start.elapsed().as_secs_f64();
        w.end_pose().expect("done");
        t
    };
    let raw_bytes = bytes as f64 / f64::from(POSES);
    for (name, c) in
        [("zstd 1", Some(mcap::Compression::Zstd)), ("lz4 1", Some(mcap::Compression::Lz4)), ("none", None)]
    {
        let (n, t) = stock(c, &frames);
        println!(
            "compression {name}: {:.3} of the raw bytes at {:.0} MB/s",
            n as f64 / raw_bytes,
            raw_bytes / t / 1e6
        );
    }
    println!("size: {:.3} of the raw bytes", size as f64 / bytes as f64);
    println!(
        "write: journal {:.0} MB/s, raw-file {:.0} MB/s, ratio {:.2}",
        bytes as f64 / ours / 1e6,
        bytes as f64 / base / 1e6,
        ours / base
    );
    println!(
        "a frame costs the caller {:.2} ms, the whole of it {:.2} ms",
        caller * 1e3,
        ours / f64::from(FRAMES * POSES) * 1e3
    );
}
