//! The messages of a session, as protobuf. Field numbers are the format; the schemas written beside them are in `schema.rs`.

use std::time::Duration;

use gonio_instrument::Pose;

/// `google.protobuf.Timestamp`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct Timestamp {
    #[prost(int64, tag = "1")]
    pub seconds: i64,
    #[prost(int32, tag = "2")]
    pub nanos: i32,
}

impl Timestamp {
    pub(crate) fn from_ns(ns: u64) -> Self {
        Self { seconds: (ns / 1_000_000_000) as i64, nanos: (ns % 1_000_000_000) as i32 }
    }
}

/// `foxglove.RawImage`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct RawImage {
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    #[prost(fixed32, tag = "2")]
    pub width: u32,
    #[prost(fixed32, tag = "3")]
    pub height: u32,
    #[prost(string, tag = "4")]
    pub encoding: String,
    #[prost(fixed32, tag = "5")]
    pub step: u32,
    #[prost(bytes = "vec", tag = "6")]
    pub data: Vec<u8>,
    #[prost(string, tag = "7")]
    pub frame_id: String,
}

/// `foxglove.Log`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct Log {
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    #[prost(int32, tag = "2")]
    pub level: i32,
    #[prost(string, tag = "3")]
    pub message: String,
    #[prost(string, tag = "4")]
    pub name: String,
}

/// `gonio.FrameInfo`: what was read beside the image with the same message sequence.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct FrameInfo {
    #[prost(uint32, tag = "1")]
    pub pose: u32,
    #[prost(uint32, tag = "2")]
    pub width: u32,
    #[prost(uint32, tag = "3")]
    pub height: u32,
    #[prost(uint64, tag = "4")]
    pub exposure_ns: u64,
    #[prost(uint64, tag = "5")]
    pub requested_ns: u64,
    #[prost(double, tag = "6")]
    pub lamp_monitor: f64,
    #[prost(bool, tag = "7")]
    pub shutter_open: bool,
    #[prost(uint64, tag = "8")]
    pub sequence: u64,
    #[prost(uint64, tag = "9")]
    pub stamp_ns: u64,
    #[prost(double, optional, tag = "10")]
    pub sensor_temperature_c: Option<f64>,
    #[prost(bytes = "vec", tag = "11")]
    pub sha256: Vec<u8>,
}

/// Where a pose stands.
pub(crate) mod pose_state {
    pub const BEGUN: i32 = 1;
    pub const DONE: i32 = 2;
    pub const GIVEN_UP: i32 = 3;
}

/// `gonio.PoseInfo`. Radians are exact; the degrees beside them are for people.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct PoseInfo {
    #[prost(uint32, tag = "1")]
    pub index: u32,
    #[prost(int32, tag = "2")]
    pub state: i32,
    #[prost(double, tag = "3")]
    pub commanded_tilt: f64,
    #[prost(double, tag = "4")]
    pub commanded_spin: f64,
    #[prost(double, tag = "5")]
    pub readback_tilt: f64,
    #[prost(double, tag = "6")]
    pub readback_spin: f64,
    #[prost(uint32, tag = "7")]
    pub frames: u32,
    #[prost(double, tag = "8")]
    pub tilt_deg: f64,
    #[prost(double, tag = "9")]
    pub spin_deg: f64,
}

impl PoseInfo {
    pub(crate) fn new(index: u32, state: i32, commanded: Pose, readback: Pose, frames: u32) -> Self {
        Self {
            index,
            state,
            commanded_tilt: commanded.tilt.radians(),
            commanded_spin: commanded.spin.radians(),
            readback_tilt: readback.tilt.radians(),
            readback_spin: readback.spin.radians(),
            frames,
            tilt_deg: readback.tilt.degrees(),
            spin_deg: readback.spin.degrees(),
        }
    }

    pub(crate) fn commanded(&self) -> Pose {
        Pose::from_radians(self.commanded_tilt, self.commanded_spin)
    }

    pub(crate) fn readback(&self) -> Pose {
        Pose::from_radians(self.readback_tilt, self.readback_spin)
    }
}

/// `gonio.Wire`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct Wire {
    #[prost(bool, tag = "1")]
    pub from_device: bool,
    #[prost(bytes = "vec", tag = "2")]
    pub bytes: Vec<u8>,
}

/// `gonio.Sensors`.
#[derive(Clone, PartialEq, prost::Message)]
pub(crate) struct SensorReading {
    #[prost(double, tag = "1")]
    pub lamp_monitor: f64,
    #[prost(double, tag = "2")]
    pub temperature_c: f64,
    #[prost(double, tag = "3")]
    pub sample_height_mm: f64,
    #[prost(bool, tag = "4")]
    pub interlock_closed: bool,
}

/// Nanoseconds of a time; saturates in the year 2554.
pub(crate) fn ns(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
