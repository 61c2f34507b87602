//! What an instrument is: description, plan, pose, frame, sample record; the traits [`Stage`] and [`Camera`].
//!
//! This room holds data and contracts only. It does no I/O, opens no device, and does not know who implements its traits:
//! a driver, a simulator or a recorded session.

pub mod builtin;
pub mod calibration;
pub mod cancel;
pub mod certificate;
pub mod description;
pub mod device;
pub mod error;
pub mod exposure;
pub mod frame;
pub mod imperfection;
pub mod misalignment;
pub mod plan;
pub mod pose;
pub mod radiometry;
pub mod sample;
pub mod texture;

pub use cancel::{Cancel, Stopping};
pub use certificate::Certificate;
pub use description::Description;
pub use device::{Camera, CameraInfo, DeviceError, LinkStatistics, Sensors, Stage, StageIdentity};
pub use error::FileError;
pub use exposure::{Exposure, PoseRecord};
pub use frame::{BayerPattern, Channel, Frame};
pub use imperfection::Imperfections;
pub use misalignment::Misalignment;
pub use plan::Plan;
pub use pose::Pose;
pub use sample::{SampleRecord, ScanKind};
pub use texture::TextureCamera;
