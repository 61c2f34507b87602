//! What a scan is told before it begins.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gonio_instrument::{CameraInfo, Description, Plan, Pose, PoseRecord, ScanKind, Sensors};

use super::bracketing::dark_exposures;
use super::preflight::{self, PreflightError};
use super::suspending::Suspenders;

/// Largest departure of the sample's surface from F1, mm: the spot must stay within the pixels' footprints.
pub const HEIGHT_TOLERANCE_MM: f64 = 0.2;

/// Everything the engine knows of the scan.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The instrument.
    pub instrument: Description,
    /// The plan as it came.
    pub plan: Plan,
    /// The camera that answered.
    pub camera: CameraInfo,
    /// What is scanned.
    pub kind: ScanKind,
    /// Poses in the order of the plan.
    pub poses: Vec<Pose>,
    /// Poses that an earlier run has measured.
    pub done: BTreeSet<u32>,
    /// Shortest lit exposure of each of these poses, from which the bracket of the next began.
    pub hints: BTreeMap<u32, Duration>,
    /// What the scan waits for.
    pub suspenders: Suspenders,
    /// Shortest and longest exposure, s.
    pub exposure_s: [f64; 2],
    /// Most exposures of a bracket.
    pub max_exposures: u32,
    /// How often each is repeated.
    pub repeats: u32,
    /// Exposure from which the first bracket begins.
    pub first_exposure: Duration,
    /// Dark frames, taken at the plan's first pose (at every pose of a dark scan).
    pub dark_exposures: Vec<Duration>,
    /// Exposures to take at each pose in place of automatic bracketing; empty for automatic.
    pub series: Vec<Duration>,
    /// Largest departure of the sample's surface from F1, mm.
    pub height_tolerance_mm: f64,
    /// How long the darkest pixels of each pose need, relative to each other ([`crate::demand::exposure_needs`]): what the time left is told from. Where
    /// empty, one over the cosine of the tilt.
    pub exposure_needs: Vec<f64>,
}

impl Setup {
    /// The usual scan of a plan.
    #[must_use]
    pub fn new(instrument: Description, plan: Plan, camera: CameraInfo, kind: ScanKind) -> Self {
        let exposure_s = instrument.camera.exposure_s;
        let middle = (exposure_s[0] * exposure_s[1]).sqrt().min(0.01);
        // whole microseconds: what cameras take and files keep
        let whole = |s: &f64| Duration::from_micros((s * 1e6).round().max(1.0) as u64);
        let series: Vec<Duration> = plan.exposure_s.iter().map(whole).collect();
        let dark_exposures = match kind {
            // each lit exposure has dark frames of its own
            ScanKind::Flat if !series.is_empty() => {
                series.iter().flat_map(|t| vec![*t; plan.repeats.max(1) as usize]).collect()
            }
            _ => dark_exposures(exposure_s),
        };
        Self {
            poses: plan.poses(),
            done: BTreeSet::new(),
            hints: BTreeMap::new(),
            suspenders: Suspenders::default(),
            exposure_s,
            max_exposures: plan.max_exposures,
            repeats: plan.repeats.max(1),
            first_exposure: Duration::from_secs_f64(middle.clamp(exposure_s[0], exposure_s[1])),
            dark_exposures,
            series,
            height_tolerance_mm: HEIGHT_TOLERANCE_MM,
            exposure_needs: Vec::new(),
            instrument,
            plan,
            camera,
            kind,
        }
    }

    /// Poses already measured are not taken again.
    #[must_use]
    pub fn resuming(mut self, done: BTreeSet<u32>) -> Self {
        self.done = done;
        self
    }

    /// What an earlier run found of the exposures of a pose, so that this one takes the same frames as an uninterrupted one.
    pub fn learn(&mut self, record: &PoseRecord) {
        let lit = record.exposures.iter().filter(|e| e.shutter_open);
        if let Some(shortest) = lit.map(|e| e.frame.exposure).min() {
            self.hints.insert(record.index, shortest);
        }
    }

    /// What can be checked without asking the device anything.
    ///
    /// # Errors
    /// [`PreflightError`].
    pub fn check(&self) -> Result<(), PreflightError> {
        preflight::check(&self.instrument, &self.plan, &self.camera)
    }

    /// What the sensors must say.
    ///
    /// # Errors
    /// [`PreflightError`].
    pub fn check_sensors(&self, sensors: &Sensors) -> Result<(), PreflightError> {
        preflight::check_sensors(sensors, self.height_tolerance_mm)
    }
}
