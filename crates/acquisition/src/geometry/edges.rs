//! Edges of known things in the picture of a white sample: the mirror's rim, its openings for lamp and shaft, and the sample's horizon (θo = 90°).
//!
//! Each is a curve `g(pixel) = 0` of the optics; an observed edge point is `g/|∇g|` pixels off it. They are sought across the curves of a first calibration by
//! spots, which is within a pixel or two of the truth. Rim and openings are steps: a half-plane that covers each pixel by its exact share is fitted. Towards
//! the horizon the lit share of a footprint falls with cos θo to nothing; divided by its known course it is a straight line, whose zero is the horizon.

use gonio_instrument::{Description, Pose};
use gonio_optics::Vec3;

use crate::footprint::lit_share_at;
use crate::merge::MergedPose;
use crate::optics::Optics;
use crate::pixel_map::PixelMap;

/// Which thing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thing {
    /// The mirror's rim.
    Rim,
    /// The opening for the lamp.
    LampOpening,
    /// The opening for the shaft.
    ShaftOpening,
    /// The sample's horizon at a pose read back.
    Horizon(Pose),
}

/// A point of an edge that was seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// Of what.
    pub thing: Thing,
    /// Where (column, row), pixels.
    pub at_px: [f64; 2],
    /// Unit normal of the edge on the sensor, towards the dark side.
    pub normal_px: [f64; 2],
    /// Standard uncertainty along the normal, pixels.
    pub sigma_px: f64,
}

/// Half the width across the curve in which an edge is sought, pixels.
const REACH_PX: f64 = 4.0;
/// Half the length along the curve.
const ALONG_PX: f64 = 2.5;
/// What the step of an edge does not know (pupil, burr), pixels.
const FLOOR_PX: f64 = 0.05;
/// The horizon's line is fitted between these distances from it, pixels.
const HORIZON_PX: [f64; 2] = [1.5, 14.0];
/// A point needs this contrast over the noise of its own pixels.
const LEAST_CONTRAST: f64 = 20.0;

impl Edge {
    /// Name in words.
    #[must_use]
    pub fn name(&self) -> String {
        let what = match self.thing {
            Thing::Rim => "rim".to_owned(),
            Thing::LampOpening => "lamp opening".to_owned(),
            Thing::ShaftOpening => "shaft opening".to_owned(),
            Thing::Horizon(pose) => format!("horizon at {pose}"),
        };
        format!("{what}, pixel ({:.0}, {:.0})", self.at_px[0], self.at_px[1])
    }

    /// How far the point seen lies beyond the predicted curve, pixels along its normal; `None` where the ray misses.
    #[must_use]
    pub fn distance_px(&self, optics: &Optics, description: &Description) -> Option<f64> {
        let g = |u: f64, v: f64| level(self.thing, optics, description, u, v);
        let (value, slope) = with_slope(&g, self.at_px)?;
        let size = slope[0].hypot(slope[1]);
        (size > 1e-12).then(|| value / size)
    }

    /// Whether the tilt's repeatability moves it.
    #[must_use]
    pub const fn moves_with_tilt(&self) -> bool {
        matches!(self.thing, Thing::Horizon(_))
    }
}

/// Grows towards the dark side and vanishes on the curve. Lengths for rim and openings (over 100 mm), a cosine for the horizon.
fn level(thing: Thing, optics: &Optics, d: &Description, u: f64, v: f64) -> Option<f64> {
    let view = optics.view(u, v)?;
    let beside = |axis: Vec3, radius: f64| {
        let m = view.mirror_mm;
        (radius - (m - axis * m.dot(axis)).norm()) / 100.0
    };
    Some(match thing {
        Thing::Rim => d.mirror.rim_eta_deg.to_radians().cos() - view.cos_eta,
        Thing::LampOpening => beside(optics.lamp(), d.lamp.opening_radius_mm),
        Thing::ShaftOpening => {
            beside(Vec3::from(d.holder.shaft.direction).normalized(), d.holder.shaft.opening_radius_mm)
        }
        Thing::Horizon(pose) => -view.direction.dot(optics.normal(pose.tilt)),
    })
}

fn with_slope(g: &dyn Fn(f64, f64) -> Option<f64>, at: [f64; 2]) -> Option<(f64, [f64; 2])> {
    const H: f64 = 0.05;
    let [u, v] = at;
    let du = (g(u + H, v)? - g(u - H, v)?) / (2.0 * H);
    let dv = (g(u, v + H)? - g(u, v - H)?) / (2.0 * H);
    Some((g(u, v)?, [du, dv]))
}

/// Points on the predicted curve, spread along it.
fn curve(thing: Thing, optics: &Optics, d: &Description, points: usize) -> Vec<[f64; 2]> {
    let g = |u: f64, v: f64| level(thing, optics, d, u, v);
    let turn = |k: usize| std::f64::consts::TAU * k as f64 / points as f64;
    match thing {
        Thing::Rim => (0..points)
            .filter_map(|k| {
                let direction = optics.mirror_direction(d.mirror.rim_eta_deg.to_radians(), turn(k));
                optics.project(optics.mirror_point(direction))
            })
            .collect(),
        Thing::Horizon(pose) => {
            let (p, q) = optics.normal(pose.tilt).orthonormal_basis();
            (0..points).filter_map(|k| optics.pixel(p * turn(k).cos() + q * turn(k).sin())).collect()
        }
        Thing::LampOpening | Thing::ShaftOpening => {
            let axis = if thing == Thing::LampOpening {
                optics.lamp()
            } else {
                Vec3::from(d.holder.shaft.direction).normalized()
            };
            let Some(middle) = optics.project(optics.mirror_point(axis)) else { return Vec::new() };
            (0..points)
                .filter_map(|k| {
                    // outwards from the middle until it is bright: g falls through zero
                    let (s, c) = turn(k).sin_cos();
                    let along = |r: f64| g(middle[0] + r * c, middle[1] + r * s);
                    let (mut low, mut high) = (0.0, 120.0);
                    if along(low)? <= 0.0 || along(high)? >= 0.0 {
                        return None;
                    }
                    for _ in 0..40 {
                        let r = 0.5 * (low + high);
                        if along(r)? > 0.0 { low = r } else { high = r }
                    }
                    Some([middle[0] + low * c, middle[1] + low * s])
                })
                .collect()
        }
    }
}

/// Edge points in a merged picture of a white sample at a pose. `gains` are the channels' relative sensitivities.
#[must_use]
pub fn find(map: &PixelMap, merged: &MergedPose, pose: Pose, gains: [f64; 3]) -> Vec<Edge> {
    let (optics, d) = (map.optics(), map.description());
    let visibility = map.visibility(pose);
    let mut out = Vec::new();
    for (thing, points) in
        [(Thing::Rim, 240), (Thing::LampOpening, 16), (Thing::ShaftOpening, 16), (Thing::Horizon(pose), 90)]
    {
        for at in curve(thing, optics, d, points) {
            let g = |u: f64, v: f64| level(thing, optics, d, u, v);
            let Some((_, slope)) = with_slope(&g, at) else { continue };
            let size = slope[0].hypot(slope[1]);
            if size < 1e-12 {
                continue;
            }
            let normal = slope.map(|s| s / size);
            // the bright side must be the sample and nothing else
            let inside = |r: f64| -> Option<bool> {
                let (x, y) = (at[0] - r * normal[0], at[1] - r * normal[1]);
                let pixel = pixel_at(map, x, y)?;
                let cos = visibility.cos_view(pixel)?;
                Some(matches!(thing, Thing::Horizon(_)) || cos > 0.2)
            };
            let bright = [4.0, 6.0, 8.0, 10.0];
            if !bright.iter().all(|&r| inside(r) == Some(true)) {
                continue;
            }
            let found = if matches!(thing, Thing::Horizon(_)) {
                horizon(map, merged, pose, at, normal, gains)
            } else {
                step(map, merged, at, normal, gains)
            };
            if let Some((shift, sigma)) = found {
                out.push(Edge {
                    thing,
                    at_px: [at[0] + shift * normal[0], at[1] + shift * normal[1]],
                    normal_px: normal,
                    sigma_px: sigma.hypot(FLOOR_PX),
                });
            }
        }
    }
    out
}

/// Pixels that [`find`] may read at a pose: all that show the mirror, or nearly so.
#[must_use]
pub fn wanted(map: &PixelMap, pose: Pose) -> Vec<bool> {
    let (optics, d) = (map.optics(), map.description());
    let mut out = vec![false; map.width() * map.height()];
    for (thing, points) in
        [(Thing::Rim, 240), (Thing::LampOpening, 16), (Thing::ShaftOpening, 16), (Thing::Horizon(pose), 90)]
    {
        let reach = if matches!(thing, Thing::Horizon(_)) { 20 } else { 9 };
        for at in curve(thing, optics, d, points) {
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    if let Some(p) = pixel_at(map, at[0] + f64::from(dx), at[1] + f64::from(dy)) {
                        out[p] = true;
                    }
                }
            }
        }
    }
    out
}

fn pixel_at(map: &PixelMap, x: f64, y: f64) -> Option<usize> {
    let within = x >= 0.0 && y >= 0.0 && x < map.width() as f64 && y < map.height() as f64;
    within.then(|| y as usize * map.width() + x as usize)
}

/// Pixels near a point: distance along the normal, value over its channel's gain, variance.
fn around(
    map: &PixelMap,
    merged: &MergedPose,
    at: [f64; 2],
    normal: [f64; 2],
    gains: [f64; 3],
    [low, high]: [f64; 2],
) -> Vec<(usize, f64, f64, f64)> {
    let reach = low.abs().max(high.abs()) + ALONG_PX + 1.0;
    let mut out = Vec::new();
    let range = |c: f64, n: usize| {
        (c - reach).floor().max(0.0) as usize..((c + reach).ceil().max(0.0) as usize).min(n)
    };
    for y in range(at[1], map.height()) {
        for x in range(at[0], map.width()) {
            let (dx, dy) = (x as f64 + 0.5 - at[0], y as f64 + 0.5 - at[1]);
            let (s, t) = (dx * normal[0] + dy * normal[1], dy * normal[0] - dx * normal[1]);
            let p = y * map.width() + x;
            let m = merged.pixels[p];
            if s < low || s > high || t.abs() > ALONG_PX || !m.is_valid() {
                continue;
            }
            let gain = gains[map.channel(p)];
            out.push((p, s, f64::from(m.rate) / gain, f64::from(m.shot + m.read + m.dark) / (gain * gain)));
        }
    }
    out
}

/// Share of a unit pixel on the near side of a straight edge at distance `s` (along the unit `normal`) from the pixel's centre.
fn share(s: f64, normal: [f64; 2]) -> f64 {
    // the pixel's profile across the edge is a trapezoid: the convolution of two boxes of widths |nx| and |ny|
    let (a, b) = (normal[0].abs().max(1e-6), normal[1].abs().max(1e-6));
    let ramp = |x: f64| if x > 0.0 { 0.5 * x * x } else { 0.0 };
    let (p, q) = (0.5 * (a + b), 0.5 * (a - b).abs());
    ((ramp(s + p) - ramp(s + q) - ramp(s - q) + ramp(s - p)) / (a * b)).clamp(0.0, 1.0)
}

/// A bright side, sloping linearly, that ends at a straight edge in the dark: the edge's distance from `at` along the normal, and its uncertainty.
fn step(
    map: &PixelMap,
    merged: &MergedPose,
    at: [f64; 2],
    normal: [f64; 2],
    gains: [f64; 3],
) -> Option<(f64, f64)> {
    let data = around(map, merged, at, normal, gains, [-REACH_PX - 2.0, REACH_PX]);
    if data.len() < 20 {
        return None;
    }
    let mut shift = 0.0;
    for turn in 0..20 {
        // level, slope and dark level are linear; the shift is one more column
        let mut normal_matrix = nalgebra::Matrix4::<f64>::zeros();
        let mut right = nalgebra::Vector4::<f64>::zeros();
        let level = data.iter().filter(|d| d.1 < shift - 2.0).map(|d| d.2).sum::<f64>()
            / data.iter().filter(|d| d.1 < shift - 2.0).count().max(1) as f64;
        for &(_, s, value, variance) in &data {
            let c = share(shift - s, normal);
            let slope = (share(shift - s + 1e-3, normal) - share(shift - s - 1e-3, normal)) / 2e-3;
            let w = 1.0 / (variance + (0.01 * level).powi(2)).max(1e-300);
            let j = nalgebra::Vector4::new(level * slope, level * c, level * c * (s - shift), level);
            let r = value - level * c;
            normal_matrix += j * j.transpose() * w;
            right += j * (r * w);
        }
        let inverse = normal_matrix.try_inverse()?;
        let x = inverse * right;
        if !x[0].is_finite() {
            return None;
        }
        shift += x[0].clamp(-1.0, 1.0);
        if shift.abs() > REACH_PX - 1.0 {
            return None;
        }
        if x[0].abs() < 1e-4 && turn > 0 {
            let residual: f64 = data
                .iter()
                .map(|&(_, s, value, _)| {
                    let c = share(shift - s, normal);
                    (value - level * (c * (1.0 + x[1] + x[2] * (s - shift)) + x[3])).powi(2)
                })
                .sum();
            let rms = (residual / data.len() as f64).sqrt();
            // an edge of something else, or none at all
            if level <= 0.0 || rms > 0.08 * level || x[3].abs() > 0.1 {
                return None;
            }
            let sigma = inverse[(0, 0)].sqrt().max(rms / level * 0.3);
            return Some((shift, sigma));
        }
    }
    None
}

/// Where the light fades to nothing: the zero of a straight line through pixel values over their known course.
fn horizon(
    map: &PixelMap,
    merged: &MergedPose,
    pose: Pose,
    at: [f64; 2],
    normal: [f64; 2],
    gains: [f64; 3],
) -> Option<(f64, f64)> {
    let (sample_from_lab, theta_i) = map.frame(pose);
    let spot_mm = map.description().lamp.spot_radius_mm;
    let cos_i = theta_i.cos();
    if cos_i < 0.05 {
        return None;
    }
    let mut n = nalgebra::Matrix2::<f64>::zeros();
    let mut r = nalgebra::Vector2::<f64>::zeros();
    let mut kept = Vec::new();
    for (p, s, value, variance) in around(map, merged, at, normal, gains, [-HORIZON_PX[1], -HORIZON_PX[0]]) {
        let v = sample_from_lab.apply(map.direction(p));
        let (column, row) = ((p % map.width()) as f64 + 0.5, (p / map.width()) as f64 + 0.5);
        let lit = lit_share_at(map.place_mm(p, &sample_from_lab), map.footprint_mm(p), spot_mm, cos_i, v);
        // per cosine: the course that is not the straight line
        let course = lit / v.z.max(1e-9) * map.optics().etendue(column, row);
        if course <= 1e-6 || v.z <= 0.0 {
            return None;
        }
        let y = value / course;
        let w = 1.0 / (variance / (course * course) + (0.01 * y).powi(2)).max(1e-300);
        kept.push((s, y, w));
    }
    if kept.len() < 20 {
        return None;
    }
    for &(s, y, w) in &kept {
        let j = nalgebra::Vector2::new(1.0, s);
        n += j * j.transpose() * w;
        r += j * (y * w);
    }
    let inverse = n.try_inverse()?;
    let line = inverse * r;
    // it must fall towards the dark side
    if line[1] >= 0.0 || line[1].abs() < LEAST_CONTRAST * inverse[(1, 1)].sqrt() {
        return None;
    }
    let zero = -line[0] / line[1];
    let chi2: f64 = kept.iter().map(|&(s, y, w)| (y - line[0] - line[1] * s).powi(2) * w).sum();
    let scale = (chi2 / (kept.len() as f64 - 2.0)).max(1.0);
    let j = nalgebra::Vector2::new(1.0, zero);
    let sigma = ((j.transpose() * inverse * j)[(0, 0)] * scale).sqrt() / line[1].abs();
    (zero.abs() < REACH_PX && sigma < 0.5).then_some((zero, sigma))
}
