//! The scans from which a radiometric calibration is made.

use gonio_instrument::{Description, Plan};

use crate::reference_plan::bracketed;

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
        ..bracketed(sample)
    }
}

/// A light trap: one pose, since nothing of the light that misses the sample depends on how it stands.
#[must_use]
pub fn trap(sample: &Plan) -> Plan {
    let tilt = sample.tilt_deg.first().copied().unwrap_or(0.0);
    Plan { tilt_deg: vec![tilt], spin_deg: vec![0.0], repeats: 4, ..bracketed(sample) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;

    #[test]
    fn plans_suit_their_instruments_and_pass_through_files() {
        for name in ["tiny", "reference"] {
            let d = builtin::description(name).expect("known").expect("readable");
            let odd = Plan { repeat_first: true, exposure_s: vec![0.01], ..d.plan.clone() };
            let mut flat = flat(&odd, &d);
            "gonio-plan".clone_into(&mut flat.format);
            flat.check(&d).expect("within the limits");
            assert_eq!((flat.exposure_s.len(), flat.repeats, flat.poses().len()), (EXPOSURES, 2, 1));
            assert!(flat.exposure_s.windows(2).all(|w| w[1] > 1.5 * w[0]), "{:?}", flat.exposure_s);
            let kept = Plan::from_toml(&flat.to_toml().expect("writable"));
            assert_eq!(kept.expect("readable").exposure_s, flat.exposure_s);
            assert!(trap(&odd).exposure_s.is_empty() && trap(&odd).poses().len() == 1);
        }
    }
}
