//! The poses from which a geometric calibration is made.
//!
//! Flat black glass over the tilts lays its spots on one curve and by itself leaves most parameters undetermined; on the wedge, spun right round at several
//! tilts, they cover the picture. Poses whose spot falls outside the picture cost a few frames and nothing else.

use gonio_instrument::Plan;

/// Spins of the wedge, degrees.
const SPINS: usize = 18;
/// Tilts of the wedge, degrees.
const TILTS_DEG: [f64; 8] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 68.0];

fn limited(sample: &Plan, tilts: impl Iterator<Item = f64>, spins: Vec<f64>, limits_deg: [f64; 2]) -> Plan {
    let tilt_deg = tilts.filter(|t| (limits_deg[0]..=limits_deg[1]).contains(t)).collect();
    Plan {
        tilt_deg,
        spin_deg: spins,
        max_exposures: 5,
        repeats: 1,
        ..crate::reference_plan::bracketed(sample)
    }
}

/// Black glass on the wedge.
#[must_use]
pub fn wedge(sample: &Plan, tilt_limits_deg: [f64; 2]) -> Plan {
    let spins = (0..SPINS).map(|k| 360.0 * k as f64 / SPINS as f64).collect();
    limited(sample, TILTS_DEG.into_iter(), spins, tilt_limits_deg)
}

/// Black glass, flat.
#[must_use]
pub fn flat(sample: &Plan, tilt_limits_deg: [f64; 2]) -> Plan {
    limited(sample, (1..=14).map(|k| 5.0 * f64::from(k)), vec![0.0, 120.0, 240.0], tilt_limits_deg)
}
