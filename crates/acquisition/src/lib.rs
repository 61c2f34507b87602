//! From raw frames to a measured BRDF, and the scan that takes the frames.
//!
//! The reduction: [`PixelMap`] traces the camera once; a [`WhiteBuilder`] turns the poses of a white reference into
//! [`WhiteReference`]; a [`Reducer`] takes the poses of a sample one after the other and gives the measured table with its
//! uncertainty, after each of them or at the end. A live scan and a replay call the same code in the same order and get the
//! same bits, on any number of threads.
//!
//! Left to others: which device stands behind `Stage` and `Camera`, how a session is written, and what is fitted to the table.

pub mod azimuths;
pub mod bracket;
pub mod budget;
pub mod cells;
pub mod closure;
pub mod coat;
pub mod dark;
pub mod demand;
pub mod engine;
pub mod error;
pub mod fill;
pub mod footprint;
mod frames;
pub mod geometry;
pub mod holder;
pub mod journal;
pub mod lamp;
mod local_fit;
pub mod merge;
pub mod merge_white;
pub mod optics;
pub mod options;
pub mod pixel_map;
pub mod radiometry;
pub mod reducer;
pub mod reference;
pub mod reference_plan;
mod robust;
pub mod row;
pub mod runner;
pub mod sensor;
pub mod statistics;
pub mod sweep;
pub mod table;
pub mod texture;
pub mod weights;

pub use azimuths::{Grain, Isotropy};
pub use coat::{CoatFit, Gloss, Verdict};
pub use engine::{Engine, Outcome, Phase, Progress, Setup};
pub use error::AcquisitionError;
pub use journal::Journal;
pub use options::{ClearCoat, Options};
pub use pixel_map::PixelMap;
pub use reducer::Reducer;
pub use reference::{WhiteBuilder, WhiteReference};
pub use runner::{Observer, run};
pub use statistics::PoseStatistics;
pub use sweep::{Sweep, Swept};
