//! Light that goes astray, added to the direct rates of a pose.
//!
//! ```text
//! x    = direct + G k lit κ S R(θo) cos θi           the camera's own face, lit by way of the mirror, lights the sample again
//! rate = (1 − g − ε) x + g mean(x) + ε K∗x + haze     veiling glare, tails of the point image, lamp light that misses the sample
//! ```
//!
//! `S = ∫ f(l, ω) W(ω) dω` over the mirror seen from F1, `W = cos ψ (|F1 M|/|M F2|)²` (irradiance at the face for radiance at F1), `R = ∫ f cos θ dω`
//! over the hemisphere, `κ = ρ_mirror² ρ_face/π`; a gloss adds Fresnel's reflectance at its direction to both. K is four Gaussians of σ, 2σ, 4σ, 8σ with
//! 8 : 4 : 2 : 1 of the light, taken channel by channel on the tiles of the filter pattern. Light beyond the picture is not known to be there.

use gonio_instrument::{BayerPattern, Description, Imperfections};
use gonio_optics::{Vec3, fresnel};
use rayon::prelude::*;

use super::sample::Sample;

/// Shares of the tail's Gaussians.
const WEIGHTS: [f64; 4] = [8.0 / 15.0, 4.0 / 15.0, 2.0 / 15.0, 1.0 / 15.0];
/// Steps in polar angle and azimuth of the integrals over the hemisphere.
const STEPS: [usize; 2] = [90, 180];

/// What goes astray in an instrument.
#[derive(Clone, Debug)]
pub struct Stray {
    glare: f64,
    tail: f64,
    /// σ of the narrowest Gaussian, tiles of the filter pattern.
    sigma_tiles: f64,
    /// κ, 1/sr.
    pub kappa: f64,
    /// Electrons per second in the middle of the haze.
    haze_e_s: f64,
    size: [u32; 2],
    pattern: BayerPattern,
    mirror_a: f64,
    mirror_c: f64,
    rim_cos: f64,
}

/// What the face gives back at a pose: κ S R(θo), on even steps of θo from 0° to 90°, channel by channel.
#[derive(Clone, Debug)]
pub struct Returned(Vec<[f64; 3]>);

impl Returned {
    /// At a view direction.
    #[must_use]
    pub fn at(&self, cos_view: f64, channel: usize) -> f64 {
        let last = self.0.len() - 1;
        let x = cos_view.clamp(0.0, 1.0).acos() / std::f64::consts::FRAC_PI_2 * last as f64;
        let k = (x as usize).min(last - 1);
        let w = x - k as f64;
        (1.0 - w) * self.0[k][channel] + w * self.0[k + 1][channel]
    }
}

impl Stray {
    /// The stray light of an instrument; `None` where there is none. `white_e_s` is what a white sample in normal light gives on the axis.
    #[must_use]
    pub fn new(d: &Description, i: &Imperfections, white_e_s: f64) -> Option<Self> {
        let none = [i.veiling_glare, i.tail_share, i.face_reflectance, i.lamp_haze].iter().all(|v| *v == 0.0);
        (!none).then(|| Self {
            glare: i.veiling_glare,
            tail: i.tail_share,
            sigma_tiles: i.tail_radius_mm / (2e-3 * d.camera.pitch_um),
            kappa: d.mirror.reflectance.powi(2) * i.face_reflectance * std::f64::consts::FRAC_1_PI,
            haze_e_s: i.lamp_haze * white_e_s,
            size: d.camera.size,
            pattern: d.camera.pattern,
            mirror_a: d.mirror.a,
            mirror_c: d.mirror.c_mm(),
            rim_cos: d.mirror.rim_eta_deg.to_radians().cos(),
        })
    }

    /// W of a lab direction from F1; 0 past the rim.
    fn weight(&self, direction: Vec3) -> f64 {
        let cos_eta = direction.z;
        if cos_eta < self.rim_cos {
            return 0.0;
        }
        let (a, c) = (self.mirror_a, self.mirror_c);
        let near = (a - c) * (a + c) / (a + c * cos_eta);
        let far = 2.0 * a - near;
        let cos_psi = (near * cos_eta + 2.0 * c) / far;
        cos_psi.max(0.0) * (near / far).powi(2)
    }

    /// What the face gives back; `lab_from_sample` turns directions, `light` is the lamp's in the sample's frame.
    #[must_use]
    pub fn returned(
        &self,
        sample: &Sample,
        light: Vec3,
        lab_from_sample: impl Fn(Vec3) -> Vec3 + Sync,
    ) -> Option<Returned> {
        if self.kappa == 0.0 || light.z <= 0.0 {
            return None;
        }
        let [polar, around] = STEPS;
        let (dt, dp) = (std::f64::consts::FRAC_PI_2 / polar as f64, std::f64::consts::TAU / around as f64);
        let over = |weight: &(dyn Fn(Vec3) -> f64 + Sync), from: Vec3| -> [f64; 3] {
            (0..polar)
                .into_par_iter()
                .map(|i| {
                    let (s, c) = ((i as f64 + 0.5) * dt).sin_cos();
                    let mut sum = [0.0; 3];
                    for j in 0..around {
                        let (sp, cp) = ((j as f64 + 0.5) * dp).sin_cos();
                        let w = Vec3::new(s * cp, s * sp, c);
                        let f = sample.base.eval(from, w);
                        let weight = weight(w) * s * dt * dp;
                        for k in 0..3 {
                            sum[k] += f[k] * weight;
                        }
                    }
                    sum
                })
                .collect::<Vec<_>>()
                .into_iter()
                .fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]])
        };
        let gloss = |cos: f64| sample.gloss_index.map_or(0.0, |n| fresnel::dielectric(cos, n));
        let mut s = over(&|w| self.weight(lab_from_sample(w)), light);
        let mirrored = lab_from_sample(Vec3::new(-light.x, -light.y, light.z));
        let bright = gloss(light.z) / light.z * self.weight(mirrored);
        s = s.map(|v| v + bright);
        let steps = 30;
        let r = (0..=steps).map(|k| {
            let theta = std::f64::consts::FRAC_PI_2 * (k as f64 / steps as f64).min(0.999);
            let v = Vec3::new(theta.sin(), 0.0, theta.cos());
            over(&|w| w.z, v).map(|d| d + gloss(v.z))
        });
        Some(Returned(r.map(|r| [0, 1, 2].map(|c| self.kappa * s[c] * r[c])).collect()))
    }

    /// Spreads the light of a picture: glare, tails, haze.
    pub fn spread(&self, rates: &mut [f32]) {
        let [w, h] = self.size.map(|n| n as usize);
        let (tw, th) = (w / 2, h / 2);
        let mut pictures: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; tw * th]);
        let channel = |x: usize, y: usize| self.pattern.channel(x as u32, y as u32) as usize;
        for y in 0..th * 2 {
            for x in 0..tw * 2 {
                let c = channel(x, y);
                let share = if c == 1 { 0.5 } else { 1.0 };
                pictures[c][y / 2 * tw + x / 2] += share * f64::from(rates[y * w + x]);
            }
        }
        let tails = pictures.each_ref().map(|p| self.tails(p, tw, th));
        let means = pictures.each_ref().map(|p| p.iter().sum::<f64>() / p.len().max(1) as f64);
        let kept = 1.0 - self.glare - self.tail;
        rates.par_chunks_mut(w).enumerate().for_each(|(y, row)| {
            for (x, rate) in row.iter_mut().enumerate() {
                let c = channel(x, y);
                let tile = (y / 2).min(th - 1) * tw + (x / 2).min(tw - 1);
                let value = kept * f64::from(*rate)
                    + self.glare * means[c]
                    + self.tail * tails[c][tile]
                    + self.haze(x as f64 / w as f64, y as f64 / h as f64);
                *rate = value as f32;
            }
        });
    }

    /// Lamp light that misses the sample, at a place from 0 to 1 across and down: even, and a glow about the opening.
    #[must_use]
    pub fn haze(&self, x: f64, y: f64) -> f64 {
        let glow = (-((x - 0.7).powi(2) + (y - 0.6).powi(2)) / 0.045).exp();
        self.haze_e_s * (0.5 + 0.2 * x + glow)
    }

    /// K∗x by separable Gaussians, cut at four σ and at the picture's edges.
    fn tails(&self, picture: &[f64], w: usize, h: usize) -> Vec<f64> {
        let mut out = vec![0.0; picture.len()];
        if self.tail == 0.0 || self.sigma_tiles <= 0.0 {
            return out;
        }
        for (j, weight) in WEIGHTS.into_iter().enumerate() {
            let kernel = gaussian(self.sigma_tiles * f64::from(1 << j));
            let across = lines(picture, w, &kernel);
            let turned = transposed(&across, w, h);
            let down = lines(&turned, h, &kernel);
            for (o, v) in out.iter_mut().zip(transposed(&down, h, w)) {
                *o += weight * v;
            }
        }
        out
    }
}

/// Half of a Gaussian that sums to one over both halves: its integral over each tile.
fn gaussian(sigma: f64) -> Vec<f64> {
    let reach = (4.0 * sigma).ceil() as usize;
    // eight points a tile
    let at = |k: usize| -> f64 {
        (0..8).map(|i| (-0.5 * ((k as f64 + (f64::from(i) + 0.5) / 8.0 - 0.5) / sigma).powi(2)).exp()).sum()
    };
    let mut half: Vec<f64> = (0..=reach).map(at).collect();
    let sum = 2.0 * half.iter().sum::<f64>() - half[0];
    half.iter_mut().for_each(|v| *v /= sum);
    half
}

fn lines(picture: &[f64], w: usize, half: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; picture.len()];
    out.par_chunks_mut(w).zip(picture.par_chunks(w)).for_each(|(to, from)| {
        for (x, to) in to.iter_mut().enumerate() {
            let mut sum = half[0] * from[x];
            for (k, g) in half.iter().enumerate().skip(1) {
                if k <= x {
                    sum += g * from[x - k];
                }
                if x + k < w {
                    sum += g * from[x + k];
                }
            }
            *to = sum;
        }
    });
    out
}

fn transposed(picture: &[f64], w: usize, h: usize) -> Vec<f64> {
    let mut out = vec![0.0; picture.len()];
    for y in 0..h {
        for x in 0..w {
            out[x * h + y] = picture[y * w + x];
        }
    }
    out
}
