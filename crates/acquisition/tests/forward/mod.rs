//! A compact forward model of the nominal instrument, independent of the crate's own optics: F2 is a focus, so the mirror point
//! follows from the polar equation of the ellipse, and the direction from F1 is that point's. No holder, no misalignment.

#![allow(dead_code)] // each test binary uses its part

use std::time::Duration;

use gonio_brdf::Brdf;
use gonio_instrument::{Description, Exposure, Frame, Pose, PoseRecord};
use gonio_optics::{Rotation, Vec3, quadrature};

/// splitmix64 with what noise needs.
pub struct Noise(pub u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in (0, 1).
    pub fn uniform(&mut self) -> f64 {
        ((self.next() >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    pub fn gauss(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    pub fn poisson(&mut self, mean: f64) -> f64 {
        if mean > 60.0 {
            return (mean + mean.sqrt() * self.gauss()).round().max(0.0);
        }
        let (limit, mut p, mut n) = ((-mean).exp(), self.uniform(), 0.0);
        while p > limit {
            p *= self.uniform();
            n += 1.0;
        }
        n
    }
}

/// Direction from the sample for an image point in pixels.
fn direction(d: &Description, column: f64, row: f64) -> Vec3 {
    let px = d.camera.f_mm / (d.camera.pitch_um * 1e-3);
    // looking along +z with y up, columns run along −x and rows along −y
    let x = -(column - 0.5 * f64::from(d.camera.size[0])) / px;
    let y = -(row - 0.5 * f64::from(d.camera.size[1])) / px;
    let ray = Vec3::new(x, y, 1.0).normalized();
    let (a, b, c) = (d.mirror.a, d.mirror.b, d.mirror.c_mm());
    let m = ray * (b * b / (a - c * ray.z)) + Vec3::new(0.0, 0.0, -2.0 * c);
    m.normalized()
}

/// Electrons per second of every pixel at a pose: `gain · ∫_lamp f cos θ'`, averaged over the pixel's area.
pub fn rates(d: &Description, brdf: &dyn Brdf, pose: Pose, gain: f64) -> Vec<f64> {
    let lamp = Vec3::from(d.lamp.direction).normalized();
    let axis = Vec3::from(d.holder.tilt_axis).normalized();
    let n = Rotation::about_axis(axis, pose.tilt).apply(Vec3::from(d.holder.normal_at_zero).normalized());
    let x = (lamp - n * lamp.dot(n)) + (n.cross(axis)) * 1e-9;
    let x = (x - n * x.dot(n)).normalized();
    let frame = Rotation::from_axes(x, n.cross(x), n);
    let lights: Vec<Vec3> =
        quadrature::cone(lamp, d.lamp.half_angle(), 2).iter().map(|l| frame.apply(*l)).collect();
    let (w, h) = (d.camera.size[0], d.camera.size[1]);
    (0..w * h)
        .map(|p| {
            let (u, v) = (p % w, p / w);
            let channel = d.camera.pattern.channel(u, v) as usize;
            let mut sum = 0.0;
            for (du, dv) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
                let view = frame.apply(direction(d, f64::from(u) + du, f64::from(v) + dv));
                if view.z > 0.0 {
                    sum += lights.iter().map(|l| brdf.eval(*l, view)[channel] * l.z.max(0.0)).sum::<f64>();
                }
            }
            gain * sum / (4 * lights.len()) as f64
        })
        .collect()
}

/// What the gloss of a coat adds to [`rates`]: the lamp's mirror image, F(θi)/Ω_lamp inside it, by 12 × 12 places a pixel.
pub fn gloss_rates(d: &Description, index: f64, pose: Pose, gain: f64) -> Vec<f64> {
    let lamp = Vec3::from(d.lamp.direction).normalized();
    let axis = Vec3::from(d.holder.tilt_axis).normalized();
    let n = Rotation::about_axis(axis, pose.tilt).apply(Vec3::from(d.holder.normal_at_zero).normalized());
    let mirror = n * (2.0 * n.dot(lamp)) - lamp;
    let alpha = d.lamp.half_angle();
    let level =
        gonio_optics::fresnel::dielectric(n.dot(lamp), index) / (std::f64::consts::PI * alpha.sin().powi(2));
    let (w, h) = (d.camera.size[0], d.camera.size[1]);
    (0..w * h)
        .map(|p| {
            let (u, v) = (f64::from(p % w), f64::from(p / w));
            if direction(d, u + 0.5, v + 0.5).angle_to(mirror).degrees() > alpha.degrees() + 6.0 {
                return 0.0;
            }
            let places = (0..144).map(|k| (f64::from(k % 12) + 0.5, f64::from(k / 12) + 0.5));
            let inside = places
                .filter(|(x, y)| direction(d, u + x / 12.0, v + y / 12.0).angle_to(mirror) <= alpha)
                .count();
            gain * level * inside as f64 / 144.0
        })
        .collect()
}

/// A raw frame of these rates; `noise` off gives the rounded expectation.
pub fn frame(
    d: &Description,
    rates: &[f64],
    exposure_s: f64,
    lamp: f64,
    sequence: u64,
    noise: &mut Option<Noise>,
) -> Frame {
    let c = &d.camera;
    let gain = c.electrons_per_count();
    let pixels = rates
        .iter()
        .map(|r| {
            let mean = r * exposure_s * lamp;
            let e = match noise {
                Some(n) => n.poisson(mean) + c.read_noise_e * n.gauss(),
                None => mean,
            };
            (f64::from(c.black_level) + e / gain).round().clamp(0.0, f64::from(c.top_code())) as u16
        })
        .collect();
    Frame {
        width: c.size[0],
        height: c.size[1],
        pixels,
        exposure: Duration::from_secs_f64(exposure_s),
        sequence,
        stamp: Duration::ZERO,
        sensor_temperature_c: None,
    }
}

/// A pose taken at these exposures with the shutter open.
pub fn record(
    d: &Description,
    brdf: &dyn Brdf,
    index: u32,
    pose: Pose,
    gain: f64,
    exposures_s: &[f64],
    noise: &mut Option<Noise>,
) -> PoseRecord {
    record_of(d, &rates(d, brdf, pose, gain), index, pose, exposures_s, noise)
}

/// A pose of given rates taken at these exposures with the shutter open.
pub fn record_of(
    d: &Description,
    rates: &[f64],
    index: u32,
    pose: Pose,
    exposures_s: &[f64],
    noise: &mut Option<Noise>,
) -> PoseRecord {
    let exposures = exposures_s
        .iter()
        .enumerate()
        .map(|(k, &t)| {
            // a lamp that drifts
            let lamp = 1.0 + 0.001 * f64::from(index) + 1e-4 * k as f64;
            Exposure {
                frame: frame(d, rates, t, lamp, 100 * u64::from(index) + k as u64, noise),
                lamp_monitor: lamp,
                shutter_open: true,
            }
        })
        .collect();
    PoseRecord { index, commanded: pose, readback: pose, exposures }
}

/// A camera of another size before the reference mirror: pixels `factor` times larger.
pub fn coarse(factor: u32) -> Description {
    let mut d = gonio_instrument::builtin::description("reference").expect("known").expect("readable");
    d.camera.size = d.camera.size.map(|n| n / factor);
    d.camera.pitch_um *= f64::from(factor);
    d
}
