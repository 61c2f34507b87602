//! Plans of reference scans: few tilts of the white that together calibrate every pixel a sample scan will use.

use gonio_instrument::{Plan, Pose};

use crate::pixel_map::PixelMap;
use crate::reference::WHITE_LIMIT_DEG;

/// Only every so many pixels along each side decide: coverage has no finer structure.
const STRIDE: usize = 4;
/// Largest θo at which a sample pose uses a pixel: the outer bound of the last bin, with what interpolation reaches over, degrees.
const NEEDED_DEG: f64 = 76.6;
/// Most tilts of a white scan.
const MOST: usize = 6;

/// A white scan for the sample plan `sample`: greedily the tilt that calibrates most of what is still missing.
///
/// A pixel that a sample pose uses (θo up to [`NEEDED_DEG`]) counts as covered when a white pose sees the reference with it below that angle.
#[must_use]
pub fn white_plan(map: &PixelMap, sample: &Plan) -> Plan {
    let d = map.description();
    let [low, high] = d.holder.tilt_limits_deg;
    let cos = |deg: f64| deg.to_radians().cos();
    let (w, h) = (map.width(), map.height());
    let stride = STRIDE.min(w / 256).max(1);
    let pixels: Vec<usize> =
        (0..h).step_by(stride).flat_map(|y| (0..w).step_by(stride).map(move |x| y * w + x)).collect();
    let seen = |tilt: f64, limit: f64| -> Vec<bool> {
        let v = map.visibility(Pose::from_degrees(tilt, 0.0));
        pixels.iter().map(|&p| v.cos_view(p).is_some_and(|c| c > limit)).collect()
    };
    let mut missing = vec![false; pixels.len()];
    for &tilt in &sample.tilt_deg {
        for (m, s) in missing.iter_mut().zip(seen(tilt, cos(NEEDED_DEG))) {
            *m |= s;
        }
    }
    let mut candidates: Vec<(f64, Vec<bool>)> = (0..=17)
        .map(|k| f64::from(k) * 5.0)
        .filter(|t| (low..=high).contains(t))
        .map(|t| (t, seen(t, cos(WHITE_LIMIT_DEG))))
        .collect();
    let mut tilts = Vec::new();
    while tilts.len() < MOST && missing.contains(&true) {
        // grazing light is weak: such a tilt is worth as much as its light
        let gain = |tilt: f64, s: &[bool]| {
            let n = s.iter().zip(&missing).filter(|(s, m)| **s && **m).count();
            n as f64 * tilt.to_radians().cos()
        };
        let gains: Vec<f64> = candidates.iter().map(|(t, s)| gain(*t, s)).collect();
        let Some(k) = (0..gains.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b])) else { break };
        if gains[k] <= 0.0 {
            break;
        }
        let (tilt, s) = candidates.remove(k);
        for (m, s) in missing.iter_mut().zip(s) {
            *m &= !s;
        }
        tilts.push(tilt);
    }
    if tilts.is_empty() {
        tilts.push(0.0f64.clamp(low, high));
    }
    tilts.sort_by(f64::total_cmp);
    Plan { tilt_deg: tilts, spin_deg: vec![0.0], repeats: 4, ..bracketed(sample) }
}

/// A plan of angles of incidence as the tilts to be read back on a calibrated instrument; as it is on one that is not calibrated.
#[must_use]
pub fn on_instrument(map: &PixelMap, plan: &Plan) -> Plan {
    let d = map.description();
    if d.calibration.is_none() {
        return plan.clone();
    }
    let [low, high] = d.holder.tilt_limits_deg;
    let tilt = |deg: &f64| {
        let tilt = map.optics().tilt_for(gonio_optics::Angle::from_degrees(*deg)).degrees();
        // whole micro-degrees, as the encoders count; never past the stops
        ((tilt * 1e6).round() * 1e-6).clamp(low, high)
    };
    Plan { tilt_deg: plan.tilt_deg.iter().map(tilt).collect(), ..plan.clone() }
}

/// The settings of a plan without what belongs to its own sample: a fixed series of exposures, the first pose once more.
pub(crate) fn bracketed(sample: &Plan) -> Plan {
    Plan { exposure_s: Vec::new(), repeat_first: false, ..sample.clone() }
}

/// A dark scan: one pose, shutter closed.
#[must_use]
pub fn dark_plan(sample: &Plan) -> Plan {
    let tilt = sample.tilt_deg.first().copied().unwrap_or(0.0);
    Plan { tilt_deg: vec![tilt], spin_deg: vec![0.0], ..bracketed(sample) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;

    #[test]
    fn a_plan_on_a_calibrated_instrument_stands_at_its_angles_of_incidence() {
        let mut d = builtin::description("tiny").expect("known").expect("readable");
        let plan = d.plan.clone();
        assert_eq!(on_instrument(&PixelMap::new(&d), &plan), plan);
        d.calibration = Some(builtin::misalignment().expect("readable"));
        let map = PixelMap::new(&d);
        let moved = on_instrument(&map, &plan);
        for (pose, deg) in moved.poses().into_iter().zip(&plan.tilt_deg) {
            assert!((map.frame(pose).1.degrees() - deg).abs() < 1e-5);
            assert!((pose.tilt.degrees() - deg).abs() > 0.1);
        }
    }

    #[test]
    fn a_few_white_tilts_cover_every_pixel_that_the_sample_plan_uses() {
        for name in ["tiny", "reference"] {
            let d = builtin::description(name).expect("known").expect("readable");
            let map = PixelMap::new(&d);
            let plan = white_plan(&map, &d.plan);
            assert!(plan.tilt_deg.len() <= MOST && plan.check(&d).is_ok(), "{:?}", plan.tilt_deg);
            let sees = |tilt: &f64, p: usize, deg: f64| {
                map.visibility(Pose::from_degrees(*tilt, 0.0))
                    .cos_view(p)
                    .is_some_and(|c| c > deg.to_radians().cos())
            };
            let step = map.width() * map.height() / 1000 + 1;
            for p in (0..map.width() * map.height()).step_by(step) {
                if d.plan.tilt_deg.iter().any(|t| sees(t, p, 76.3)) {
                    assert!(
                        plan.tilt_deg.iter().any(|t| sees(t, p, WHITE_LIMIT_DEG)),
                        "{name}: pixel {p}, {:?}",
                        plan.tilt_deg
                    );
                }
            }
        }
    }
}
