//! The scans from which a radiometric calibration is made.

use gonio_instrument::{Description, Plan};

/// Exposures of a flat series.
const EXPOSURES: usize = 14;
/// Shortest and longest of them, s, as far as the camera can.
const RANGE_S: [f64; 2] = [1e-4, 0.1];

/// A white sample in the steepest light: a series of exposures up to where the camera saturates, each twice, with dark frames at each.
#[must_use]
pub fn flat(sample: &Plan, instrument: &Description) -> Plan {
    let [low, high] = instrument.holder.tilt_limits_deg;
    let [shortest, longest] = instrument.camera.exposure_s;
    let [first, last] = RANGE_S.map(|t| t.clamp(shortest, longest));
    let exposure_s = (0..EXPOSURES)
        // whole microseconds
        .map(|k| (first * (last / first).powf(k as f64 / (EXPOSURES - 1) as f64) * 1e6).round() * 1e-6)
        .map(|t| t.clamp(shortest, longest))
        .collect();
    Plan {
        tilt_deg: vec![0f64.clamp(low, high)],
        spin_deg: vec![0.0],
        // lit and dark
        max_exposures: 2 * EXPOSURES as u32,
        repeats: 2,
        exposure_s,
        ..sample.clone()
    }
}

/// A light trap: one pose, since nothing of the light that misses the sample depends on how it stands.
#[must_use]
pub fn trap(sample: &Plan) -> Plan {
    let tilt = sample.tilt_deg.first().copied().unwrap_or(0.0);
    Plan { tilt_deg: vec![tilt], spin_deg: vec![0.0], repeats: 4, ..sample.clone() }
}
