//! Edges of known things in the picture of a white sample: the mirror's rim and its openings for lamp and shaft.
//!
//! Each is a curve `g(pixel) = 0` of the optics; an observed edge point is `g/|∇g|` pixels off it. They are sought across the curves of a first calibration by
//! spots, which is within a pixel or two of the truth: a step at a constant distance from the curve, covering each pixel by its exact share, is fitted.
//!
//! The horizon of the sample (θo = 90°) is no such edge: what is lit is a spot of a few millimetres, and where mirror or camera stand off by more than a
//! footprint's radius (0.4 mm) it leaves the footprint degrees before the horizon. How the light fades there is another observation ([`super::horizon`]).

use gonio_instrument::{Description, Pose};
use gonio_optics::Vec3;
use nalgebra::{Matrix4, Vector4};

use super::horizon;
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
    /// The fading of the light towards the sample's horizon.
    Horizon {
        /// At which pose.
        pose: Pose,
        /// How far off F1 the half-lit pixel looks, in the measure of the lamp's spot, mm on the sample.
        beside_mm: f64,
        /// How much earlier the light fades by more of it.
        px_per_mm: f64,
    },
}

/// What is sought, and at how many points.
const SOUGHT: [(Thing, usize); 3] = [(Thing::Rim, 240), (Thing::LampOpening, 16), (Thing::ShaftOpening, 16)];

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

impl Edge {
    /// Name in words.
    #[must_use]
    pub fn name(&self) -> String {
        let what = match self.thing {
            Thing::Rim => "rim",
            Thing::LampOpening => "lamp opening",
            Thing::ShaftOpening => "shaft opening",
            Thing::Horizon { pose, .. } => {
                return format!(
                    "horizon of the white sample ({pose}), pixel ({:.0}, {:.0})",
                    self.at_px[0], self.at_px[1]
                );
            }
        };
        format!("{what}, pixel ({:.0}, {:.0})", self.at_px[0], self.at_px[1])
    }

    /// How far the point seen lies beyond the predicted curve, pixels along its normal; `None` where the ray misses.
    #[must_use]
    pub fn distance_px(&self, optics: &Optics, description: &Description) -> Option<f64> {
        if let Thing::Horizon { pose, beside_mm, px_per_mm } = self.thing {
            return horizon::distance_px(optics, description, pose, self.at_px, beside_mm, px_per_mm);
        }
        let g = |u: f64, v: f64| level(self.thing, optics, description, u, v);
        let (value, slope) = with_slope(&g, self.at_px)?;
        let size = slope[0].hypot(slope[1]);
        (size > 1e-12).then(|| value / size)
    }
}

/// Grows towards the dark side and vanishes on the curve. A cosine for the rim, a length over 100 mm for openings.
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
        Thing::Horizon { .. } => return None,
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
        // not a curve of the optics alone
        Thing::Horizon { .. } => Vec::new(),
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
    for (thing, points) in SOUGHT {
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
                Some(cos > 0.2)
            };
            let bright = [4.0, 6.0, 8.0, 10.0];
            if !bright.iter().all(|&r| inside(r) == Some(true)) {
                continue;
            }
            let distance = |u: f64, v: f64| g(u, v).map(|value| value / size);
            let found = step(&around(map, merged, at, &distance, gains), normal);
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

pub(super) fn pixel_at(map: &PixelMap, x: f64, y: f64) -> Option<usize> {
    let within = x >= 0.0 && y >= 0.0 && x < map.width() as f64 && y < map.height() as f64;
    within.then(|| y as usize * map.width() + x as usize)
}

/// A pixel near an edge.
struct Near {
    /// Distance of its centre beyond the predicted curve, towards the dark side, pixels.
    beyond: f64,
    /// Value over its channel's gain.
    value: f64,
    /// Variance of that.
    variance: f64,
}

/// Pixels near a point of a curve.
fn around(
    map: &PixelMap,
    merged: &MergedPose,
    at: [f64; 2],
    distance: &dyn Fn(f64, f64) -> Option<f64>,
    gains: [f64; 3],
) -> Vec<Near> {
    let reach = REACH_PX + 2.0;
    let range = |c: f64, n: usize| {
        (c - reach).floor().max(0.0) as usize..((c + reach).ceil().max(0.0) as usize).min(n)
    };
    let mut out = Vec::new();
    for y in range(at[1], map.height()) {
        for x in range(at[0], map.width()) {
            let p = y * map.width() + x;
            let m = merged.pixels[p];
            let (u, v) = (x as f64 + 0.5, y as f64 + 0.5);
            let Some(beyond) = distance(u, v).filter(|_| m.is_valid()) else { continue };
            // along the curve what is left of the way
            let along2 = (u - at[0]).powi(2) + (v - at[1]).powi(2) - beyond * beyond;
            if !(-REACH_PX - 2.0..=REACH_PX).contains(&beyond) || along2 > ALONG_PX * ALONG_PX {
                continue;
            }
            let gain = gains[map.channel(p)];
            out.push(Near {
                beyond,
                value: f64::from(m.rate) / gain,
                variance: f64::from(m.shot + m.read + m.dark) / (gain * gain),
            });
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

/// A bright side, sloping linearly, that ends in the dark at a constant distance from the curve: that distance, and its uncertainty.
fn step(data: &[Near], normal: [f64; 2]) -> Option<(f64, f64)> {
    if data.len() < 20 {
        return None;
    }
    let mut shift = 0.0;
    for turn in 0..20 {
        // level, slope and dark level are linear; the shift is one more column
        let mut equations = Matrix4::<f64>::zeros();
        let mut right = Vector4::<f64>::zeros();
        let bright = || data.iter().filter(|d| d.beyond < shift - 2.0);
        let level = bright().map(|d| d.value).sum::<f64>() / bright().count().max(1) as f64;
        for d in data {
            let s = d.beyond;
            let c = share(shift - s, normal);
            let slope = (share(shift - s + 1e-3, normal) - share(shift - s - 1e-3, normal)) / 2e-3;
            let w = 1.0 / (d.variance + (0.01 * level).powi(2)).max(1e-300);
            let j = Vector4::new(level * slope, level * c, level * c * (s - shift), level);
            equations += j * j.transpose() * w;
            right += j * ((d.value - level * c) * w);
        }
        let inverse = equations.try_inverse()?;
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
                .map(|d| {
                    let c = share(shift - d.beyond, normal);
                    (d.value - level * (c * (1.0 + x[1] + x[2] * (d.beyond - shift)) + x[3])).powi(2)
                })
                .sum();
            let rms = (residual / data.len() as f64).sqrt();
            // an edge of something else, or none at all
            if level <= 0.0 || rms > 0.08 * level || x[3].abs() > 0.1 {
                return None;
            }
            return Some((shift, inverse[(0, 0)].sqrt().max(0.3 * rms / level)));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_of_a_pixel_is_that_by_brute_force() {
        for (s, turn) in [(0.0, 0.3), (0.2, 0.7), (-0.4, 1.2), (0.6, 0.785), (0.3, 0.0)] {
            let normal = [f64::cos(turn), f64::sin(turn)];
            let n = 400;
            let inside = (0..n * n)
                .filter(|k| {
                    let at = |i: i32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
                    at(k % n) * normal[0] + at(k / n) * normal[1] < s
                })
                .count();
            let brute = inside as f64 / f64::from(n * n);
            assert!((share(s, normal) - brute).abs() < 3e-3, "{s} {turn}: {} {brute}", share(s, normal));
        }
    }

    #[test]
    fn a_step_is_found_where_it_is_and_a_plain_is_none() {
        let normal = [0.8, 0.6];
        let data = |edge: Option<f64>| -> Vec<Near> {
            (-6..=4)
                .flat_map(|i| (0..6).map(move |j| f64::from(i) + 0.17 * f64::from(j)))
                .map(|beyond| {
                    let c = edge.map_or(1.0, |e| share(e - beyond, normal));
                    Near { beyond, value: 1000.0 * c * (1.0 + 0.01 * beyond), variance: 100.0 }
                })
                .collect()
        };
        for edge in [-0.7, 0.0, 0.33] {
            let (found, sigma) = step(&data(Some(edge)), normal).expect("an edge");
            assert!((found - edge).abs() < 0.01 && sigma < 0.05, "{edge}: {found} ± {sigma}");
        }
        assert!(step(&data(None), normal).is_none());
    }
}
