//! Where the light of a white sample fades towards its horizon: what mirror and camera look at, against the lamp's spot.
//!
//! A pixel sees the pupil's image, drawn out to ρ/cos θo on the sample. Where mirror or camera stand off their places that image lies beside F1 by a
//! fraction of a millimetre across the line of sight, which no black glass can tell: its mirror image shows directions only. On the sample it is
//! 1/cos θo times as much, so that near the horizon the footprint leaves the lit spot, degrees before it would on an aligned instrument. Where the light
//! has fallen to half tells how far off F1 that pixel looks, in the measure of the spot, to some hundredths of a millimetre, but not to which side:
//! a footprint beside the spot by as much on another side fades the same. Direction and sign follow from many azimuths and tilts together.
//!
//! In each azimuth the merged rates over étendue are fitted by `A (1 + b θo) · lit(offset)`, the lit share as in [`crate::footprint`].

use gonio_instrument::{Description, Pose};
use gonio_optics::{Angle, Vec3};
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use super::edges::{Edge, Thing, pixel_at};
use super::parameters::{CAMERA_SHIFT, Estimate, MIRROR_SHIFT, Row};
use crate::footprint::Footprint;
use crate::merge::MergedPose;
use crate::optics::Optics;
use crate::pixel_map::PixelMap;

/// Azimuths in which the fading is looked for, about the normal.
const AZIMUTHS: usize = 24;
/// Polar angles that are read, degrees, and their step.
const FROM_DEG: f64 = 55.0;
const TO_DEG: f64 = 89.6;
const STEP_DEG: f64 = 0.3;
/// Largest offset that is looked for, mm across the line of sight.
const LARGEST_MM: f64 = 1.6;
/// Step of that search, mm.
const SEARCH_MM: f64 = 0.05;
/// Fewest pixels in full light, and in the fading.
const FEWEST: usize = 24;
/// Residual over level from which on it is no fading of a lamp's spot, relative.
const LARGEST_RESIDUAL: f64 = 0.04;
/// What the model of the fading does not know (rim of the spot, pupil, the sample's own law near grazing), pixels.
const FLOOR_PX: f64 = 1.0;
/// An offset is never known better than this, mm.
const FLOOR_MM: f64 = 0.02;
/// One below this not better than by as much: the fading hardly depends on it, mm.
const NEAR_ZERO_MM: f64 = 0.08;
/// Nor is any known worse, mm.
const CEILING_MM: f64 = 0.2;

/// What a place on the sensor looks at, and the cosine of the angle of incidence; `None` where nothing above the horizon is seen.
fn sight(optics: &Optics, d: &Description, pose: Pose, [u, v]: [f64; 2]) -> Option<(Footprint, f64)> {
    let view = optics.view(u, v)?;
    let (sample_from_lab, theta_i) = optics.frame(pose.tilt);
    let pupil = 0.5 * d.camera.pupil_diameter_mm;
    let seen = Footprint::new(optics, pupil, view.mirror_mm, view.direction, &sample_from_lab)?;
    (seen.view.z > 1e-4).then(|| (seen, theta_i.cos()))
}

/// How far off F1 a place on the sensor looks along its azimuth, across the line of sight, mm.
pub(super) fn offset_mm(optics: &Optics, d: &Description, pose: Pose, at: [f64; 2]) -> Option<f64> {
    Some(sight(optics, d, pose, at)?.0.offset_mm()[0])
}

/// How far a fading seen lies beyond the predicted one, pixels; `None` where the place looks below the horizon.
pub(super) fn distance_px(
    optics: &Optics,
    d: &Description,
    pose: Pose,
    at: [f64; 2],
    beside_mm: f64,
    px_per_mm: f64,
) -> Option<f64> {
    let (seen, cos_i) = sight(optics, d, pose, at)?;
    Some((seen.beside_mm(cos_i) - beside_mm) * px_per_mm)
}

/// Half the width of the search for where mirror and camera stand together, and its step, mm.
const TOGETHER_MM: f64 = 1.0;
const TOGETHER_STEP_MM: f64 = 0.25;
/// Standard deviations beyond which a fading counts no more in that search.
const FAR_OFF: f64 = 30.0;

/// Where a descent begins: mirror and camera moved together, which moves no direction, to where the fadings are explained best. A fading does
/// not tell to which side a pixel looks past F1, so from far off a descent alone might end on a wrong one.
pub(super) fn start(description: &Description, edges: &[Edge], row: &Row) -> Row {
    let fadings: Vec<&Edge> = edges.iter().filter(|e| matches!(e.thing, Thing::Horizon { .. })).collect();
    if fadings.is_empty() {
        return *row;
    }
    let cost = |row: &Row| -> f64 {
        let optics = Optics::with(description, &Estimate::from_row(row).instrument);
        let off = |e: &&Edge| {
            e.distance_px(&optics, description).map_or(FAR_OFF, |d| (d / e.sigma_px).abs().min(FAR_OFF))
        };
        fadings.iter().map(off).sum()
    };
    let steps = (TOGETHER_MM / TOGETHER_STEP_MM) as i32;
    let side = (2 * steps + 1) as usize;
    let moved = |k: usize| {
        let mut there = *row;
        for (axis, place) in [k % side, k / side % side, k / side / side].into_iter().enumerate() {
            let by = TOGETHER_STEP_MM * f64::from(place as i32 - steps);
            there[MIRROR_SHIFT + axis] += by;
            there[CAMERA_SHIFT + axis] += by;
        }
        there
    };
    let costs: Vec<f64> = (0..side.pow(3)).into_par_iter().map(|k| cost(&moved(k))).collect();
    let best = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(0);
    if costs[best] < cost(row) { moved(best) } else { *row }
}

/// A pixel on the way to the horizon.
struct Seen {
    footprint: Footprint,
    cos_i: f64,
    value: f64,
}

impl Seen {
    /// Share of what it looks at that is lit, were it looking there with its offset changed.
    fn lit(&self, spot_mm: f64, by_mm: [f64; 2]) -> f64 {
        self.footprint.moved(by_mm).lit_share(spot_mm, self.cos_i)
    }

    /// Polar angle of view less about that of the horizon's fading, radians.
    fn theta(&self) -> f64 {
        self.footprint.view.z.acos() - 1.2
    }
}

/// The fadings in a merged picture of a white sample at a pose. `gains` are the channels' relative sensitivities.
#[must_use]
pub fn find(map: &PixelMap, merged: &MergedPose, pose: Pose, gains: [f64; 3]) -> Vec<Edge> {
    let visibility = map.visibility(pose);
    let (sample_from_lab, _) = map.optics().frame(pose.tilt);
    let lab_from_sample = sample_from_lab.inverse();
    (0..AZIMUTHS)
        .into_par_iter()
        .filter_map(|k| {
            let phi = Angle::from_degrees(360.0 * k as f64 / AZIMUTHS as f64);
            let place = |theta_deg: f64| {
                let v = Vec3::from_polar(Angle::from_degrees(theta_deg), phi);
                map.optics().pixel(lab_from_sample.apply(v))
            };
            let mut seen = Vec::new();
            let steps = ((TO_DEG - FROM_DEG) / STEP_DEG) as usize;
            for theta_deg in (0..=steps).map(|s| FROM_DEG + STEP_DEG * s as f64) {
                let Some([u, v]) = place(theta_deg) else { continue };
                // a block of the mosaic
                for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                    let Some(p) = pixel_at(map, u + dx, v + dy) else { continue };
                    let m = merged.pixels[p];
                    if !m.is_valid() || visibility.cos_view(p).is_none_or(|c| c < 2e-3) {
                        continue;
                    }
                    let at = [(p % map.width()) as f64 + 0.5, (p / map.width()) as f64 + 0.5];
                    let Some((seen_there, cos_i)) = sight(map.optics(), map.description(), pose, at) else {
                        continue;
                    };
                    let value =
                        f64::from(m.rate) / (gains[map.channel(p)] * map.optics().etendue(at[0], at[1]));
                    seen.push(Seen { footprint: seen_there, cos_i, value });
                }
            }
            one(map, pose, &seen, &place)
        })
        .collect()
}

/// The fading in one azimuth.
fn one(map: &PixelMap, pose: Pose, seen: &[Seen], place: &dyn Fn(f64) -> Option<[f64; 2]>) -> Option<Edge> {
    if seen.len() < 3 * FEWEST {
        return None;
    }
    let (optics, d) = (map.optics(), map.description());
    let spot = d.lamp.spot_radius_mm;
    // the offset is looked for in the direction in which it is expected; where none is, along the azimuth, which tells most
    let middle = sight(optics, d, pose, place(80.0)?)?.0.offset_mm();
    let expected = middle[0].hypot(middle[1]);
    let way = if expected > NEAR_ZERO_MM { middle.map(|m| m / expected) } else { [1.0, 0.0] };
    let start = middle[0] * way[0] + middle[1] * way[1];
    let by = |offset: f64| way.map(|w| w * (offset - start));
    // level and slope are linear: the sum of squares that they leave
    let left = |offset: f64| -> Option<(f64, f64, Vec<f64>)> {
        let lit: Vec<f64> = seen.iter().map(|s| s.lit(spot, by(offset))).collect();
        let (mut m, mut r) = (Matrix2::zeros(), Vector2::zeros());
        for (s, l) in seen.iter().zip(&lit) {
            let j = Vector2::new(*l, l * s.theta());
            m += j * j.transpose();
            r += j * s.value;
        }
        let x = m.try_inverse()? * r;
        let squares = seen
            .iter()
            .zip(&lit)
            .map(|(s, l)| (s.value - l * (x[0] + x[1] * s.theta())).powi(2))
            .sum::<f64>();
        Some((squares, x[0], lit))
    };
    let at = |steps: f64| left(SEARCH_MM * steps).map_or(f64::INFINITY, |v| v.0);
    let steps = (LARGEST_MM / SEARCH_MM) as usize;
    let squares: Vec<f64> = (0..=steps).map(|k| at(k as f64)).collect();
    let best = (0..=steps).min_by(|&a, &b| squares[a].total_cmp(&squares[b]))?;
    if best == steps || !squares[best].is_finite() {
        return None;
    }
    // golden section about it
    let (mut low, mut high) = ((best as f64 - 1.0).max(0.0), best as f64 + 1.0);
    for _ in 0..20 {
        let (a, b) = (high - 0.618 * (high - low), low + 0.618 * (high - low));
        if at(a) < at(b) { high = b } else { low = a }
    }
    let found = 0.5 * (low + high) * SEARCH_MM;
    let (squares, level, lit) = left(found)?;
    let rms = (squares / seen.len() as f64).sqrt();
    let count = |low: f64, high: f64| lit.iter().filter(|l| (low..high).contains(*l)).count();
    if level <= 0.0
        || rms > LARGEST_RESIDUAL * level
        || count(0.98, 1.1) < FEWEST
        || count(0.05, 0.9) < FEWEST
    {
        return None;
    }
    // half of the light, as found and with a little more offset
    let half = |offset: f64| -> Option<[f64; 2]> {
        let lit = |deg: f64| {
            let (f, cos_i) = sight(optics, d, pose, place(deg)?)?;
            Some(f.moved(by(offset)).lit_share(spot, cos_i))
        };
        let (mut low, mut high) = (FROM_DEG, TO_DEG);
        if lit(low)? < 0.5 || lit(high)? > 0.5 {
            return None;
        }
        for _ in 0..30 {
            let mid = 0.5 * (low + high);
            if lit(mid)? > 0.5 { low = mid } else { high = mid }
        }
        place(low)
    };
    let (at_px, earlier) = (half(found)?, half(found + SEARCH_MM)?);
    // beyond the picture's border it would be a guess
    pixel_at(map, at_px[0], at_px[1])?;
    let fading = [at_px[0] - earlier[0], at_px[1] - earlier[1]];
    let length = fading[0].hypot(fading[1]);
    let (there, cos_i) = sight(optics, d, pose, at_px)?;
    let beside = |offset: f64| there.moved(by(offset)).beside_mm(cos_i);
    let on_sample = (beside(found + SEARCH_MM) - beside(found)) / SEARCH_MM;
    if length < 1e-3 || on_sample < 1e-3 {
        return None;
    }
    // what the sum of squares itself says: it grows by rms² for one standard deviation
    let curvature = (at(found / SEARCH_MM + 1.0) - squares).max(0.0) / (SEARCH_MM * SEARCH_MM);
    let noise_mm = rms / curvature.sqrt().max(1e-12);
    let floor = if found < NEAR_ZERO_MM { NEAR_ZERO_MM } else { FLOOR_MM };
    let sigma_mm = noise_mm.hypot(FLOOR_PX * SEARCH_MM / length).clamp(floor, CEILING_MM);
    let px_per_mm = length / (SEARCH_MM * on_sample);
    Some(Edge {
        thing: Thing::Horizon { pose, beside_mm: beside(found), px_per_mm },
        at_px,
        normal_px: fading.map(|w| w / length),
        sigma_px: sigma_mm * on_sample * px_per_mm,
    })
}
