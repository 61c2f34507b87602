//! The mean of a surface's reflectance over a pixel and the lamp: `∫∫ k f cos θ' dω' dA / Ω`.
//!
//! Four dimensions (place in the pixel, point of the lamp) are averaged together. Where the reflectance is smooth, eight points that
//! move in all four at once (rows of a Hadamard matrix, exact to third degree) are enough; their departure from the middle value measures the
//! curvature and calls finer rules: 9 × 7 points, then 36 × 61, then 144 × 331. Tables have kinks between which no curvature is seen: there the spread
//! of the eight values decides, and 9 × 37 points follow. The gloss of a smooth surface is no lobe to be sampled: it is the lamp's
//! mirror image, `F/Ω` inside and nothing outside, and its share of the pixel is cut exactly line by line.

use gonio_brdf::Brdf;
use gonio_optics::{Vec3, fresnel};

use super::lamp::{Disc, radon7, rings};

/// Curvature, relative to the mean, up to which eight points serve. Their error is of the order of its square.
const SMOOTH: f64 = 0.015;
/// Spread of the eight values, relative to their mean, up to which they serve where kinks are to be expected.
const LEVEL: f64 = 0.15;
/// Difference between a rule and the next finer one up to which the latter serves.
const FAIRLY_SMOOTH: f64 = 0.01;
/// Sharpness (an exponent, see [`Brdf::sharpness`]) from which the finest rule may be called.
const NEEDLE: f64 = 3000.0;
/// Within this angle beyond the mirror image the finer rules are always taken, degrees.
const MIRROR_MARGIN_DEG: f64 = 2.0;
/// Lines of a pixel in which the edge of the mirror image is cut.
const LINES: usize = 192;

/// One corner of a pixel (or place inside it) as the sample sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    /// Unit direction to the camera, sample frame.
    pub view: Vec3,
    /// k: étendue times mirror reflectance.
    pub k: f64,
}

/// A pixel between its four corners, in the order top left, top right, bottom left, bottom right.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch(pub [Look; 4]);

impl Patch {
    /// The place at (u, v) in [0, 1]².
    fn at(&self, u: f64, v: f64) -> Look {
        let w = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        let (mut view, mut k) = (Vec3::ZERO, 0.0);
        for (look, w) in self.0.iter().zip(w) {
            view = view + look.view * w;
            k += look.k * w;
        }
        Look { view: view.normalized(), k }
    }
}

/// Everything about lamp and surface that is the same for all pixels of a pose.
pub(crate) struct Averager<'a> {
    base: &'a dyn Brdf,
    gloss_index: Option<f64>,
    omega_sr: f64,
    mirror: Vec3,
    /// Chord (2 sin(α/2)) of the lamp's radius.
    image_chord: f64,
    /// Chord of the zone around the mirror direction in which the finer rules are taken.
    zone_chord: f64,
    centre: LampPoint,
    joint: [(LampPoint, f64, f64); 8],
    radon: Vec<(LampPoint, f64)>,
    few_rings: Vec<LampPoint>,
    rings: Vec<LampPoint>,
    many_rings: Vec<LampPoint>,
    lit: bool,
    /// The reflectance has no analytic form, and may have kinks.
    kinked: bool,
}

/// A direction to the lamp with its cosine over cos ε.
#[derive(Clone, Copy)]
struct LampPoint {
    light: Vec3,
    cosine: f64,
}

impl<'a> Averager<'a> {
    /// For a lamp whose centre lies along `light` in the sample frame.
    pub fn new(
        base: &'a dyn Brdf,
        gloss_index: Option<f64>,
        light: Vec3,
        disc: Disc,
        half_angle_rad: f64,
        omega_sr: f64,
    ) -> Self {
        let point = |p: [f64; 2]| {
            let (l, inverse_cos) = disc.direction(p);
            LampPoint { light: l, cosine: l.z.max(0.0) * inverse_cos }
        };
        // rows of a Hadamard matrix and their opposites; half the radius and 1/√12 of the side are standard deviations
        let side = 1.0 / 12f64.sqrt();
        const SIGNS: [[f64; 4]; 4] =
            [[1.0, 1.0, 1.0, 1.0], [1.0, -1.0, 1.0, -1.0], [1.0, 1.0, -1.0, -1.0], [1.0, -1.0, -1.0, 1.0]];
        let joint = std::array::from_fn(|i| {
            let s = if i < 4 { 1.0 } else { -1.0 };
            let h = SIGNS[i % 4].map(|x| x * s);
            (point([0.5 * h[0], 0.5 * h[1]]), 0.5 + side * h[2], 0.5 + side * h[3])
        });
        Self {
            base,
            gloss_index,
            omega_sr,
            mirror: Vec3::new(-light.x, -light.y, light.z),
            image_chord: 2.0 * (0.5 * half_angle_rad).sin(),
            zone_chord: 2.0 * (0.5 * (half_angle_rad + MIRROR_MARGIN_DEG.to_radians())).sin(),
            centre: point([0.0, 0.0]),
            joint,
            radon: radon7().into_iter().map(|(p, w)| (point(p), w)).collect(),
            few_rings: rings(3).into_iter().map(point).collect(),
            rings: rings(4).into_iter().map(point).collect(),
            many_rings: rings(10).into_iter().map(point).collect(),
            lit: light.z > -half_angle_rad.sin(),
            kinked: base.sharpness() == 0.0,
        }
    }

    /// Whether any light reaches the surface.
    pub fn lit(&self) -> bool {
        self.lit
    }

    /// Value for one direction, averaged over the lamp alone; for places inside pixels that are only partly free.
    pub fn place(&self, look: Look, channel: usize) -> f64 {
        let base: f64 = self.radon.iter().map(|(l, w)| w * self.value(l, look.view, channel)).sum();
        let gloss = match self.gloss_index {
            Some(n) if (look.view - self.mirror).norm() <= self.image_chord => {
                fresnel::dielectric(look.view.z, n) / self.omega_sr
            }
            _ => 0.0,
        };
        look.k * (base + gloss)
    }

    fn value(&self, l: &LampPoint, view: Vec3, channel: usize) -> f64 {
        if l.cosine <= 0.0 { 0.0 } else { self.base.eval(l.light, view)[channel] * l.cosine }
    }

    /// Mean over a whole pixel, k included, without the gloss of a smooth surface.
    pub fn smooth_part(&self, patch: &Patch, channel: usize) -> f64 {
        let middle = patch.at(0.5, 0.5);
        let single = middle.k * self.value(&self.centre, middle.view, channel);
        let (mut sum, mut low, mut high) = (0.0, f64::INFINITY, 0.0f64);
        for &(l, u, v) in &self.joint {
            let look = patch.at(u, v);
            let value = look.k * self.value(&l, look.view, channel);
            sum += value;
            low = low.min(value);
            high = high.max(value);
        }
        let eight = 0.125 * sum;
        let near = (middle.view - self.mirror).norm() <= self.zone_chord;
        if self.kinked {
            // differences of rules may vanish by chance at a kink; the spread does not
            let flat = (eight - single).abs() <= SMOOTH * eight && high - low <= LEVEL * eight;
            return if flat { eight } else { self.product(patch, channel, 3, &self.few_rings) };
        }
        if !near && (eight - single).abs() <= SMOOTH * eight {
            return eight;
        }
        // Gauss–Legendre, three points a side
        let g = 0.5 * 0.6f64.sqrt();
        let gauss = [(0.5 - g, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + g, 5.0 / 18.0)];
        let mut fine = 0.0;
        for (v, wv) in gauss {
            for (u, wu) in gauss {
                let look = patch.at(u, v);
                let mean: f64 = self.radon.iter().map(|(l, w)| w * self.value(l, look.view, channel)).sum();
                fine += wu * wv * look.k * mean;
            }
        }
        if (fine - eight).abs() <= FAIRLY_SMOOTH * fine {
            return fine;
        }
        let finer = self.product(patch, channel, 6, &self.rings);
        if self.base.sharpness() < NEEDLE || (finer - fine).abs() <= FAIRLY_SMOOTH * finer {
            return finer;
        }
        self.product(patch, channel, 12, &self.many_rings)
    }

    /// Mean over `side`² places of equal weight and the given points of the lamp.
    fn product(&self, patch: &Patch, channel: usize, side: u32, lamp: &[LampPoint]) -> f64 {
        let step = 1.0 / f64::from(side);
        let mut sum = 0.0;
        for j in 0..side {
            for i in 0..side {
                let look = patch.at((f64::from(i) + 0.5) * step, (f64::from(j) + 0.5) * step);
                sum += look.k * lamp.iter().map(|l| self.value(l, look.view, channel)).sum::<f64>();
            }
        }
        sum * step * step / lamp.len() as f64
    }

    /// `k F/Ω` times the share of the pixel that sees the lamp's mirror image.
    pub fn gloss_part(&self, patch: &Patch) -> f64 {
        let Some(index) = self.gloss_index else { return 0.0 };
        let middle = patch.at(0.5, 0.5);
        let reach = patch.0.iter().map(|c| (c.view - middle.view).norm()).fold(0.0, f64::max);
        let off = (middle.view - self.mirror).norm();
        if off > self.image_chord + reach {
            return 0.0;
        }
        let sheen = |look: Look| look.k * fresnel::dielectric(look.view.z, index) / self.omega_sr;
        if off + reach < self.image_chord {
            return sheen(middle);
        }
        let [tl, tr, bl, br] = self.patch_corners(patch);
        let mut sum = 0.0;
        for i in 0..LINES {
            let v = (i as f64 + 0.5) / LINES as f64;
            let left = tl * (1.0 - v) + bl * v;
            let across = tr * (1.0 - v) + br * v - left;
            // |left + across u − mirror|² = chord², solved for u
            let o = left - self.mirror;
            let (a, b) = (across.norm_squared(), o.dot(across));
            let disc = b * b - a * (o.norm_squared() - self.image_chord * self.image_chord);
            if disc <= 0.0 || a == 0.0 {
                continue;
            }
            let root = disc.sqrt();
            let (u0, u1) = (((-b - root) / a).max(0.0), ((-b + root) / a).min(1.0));
            if u1 > u0 {
                sum += (u1 - u0) * sheen(patch.at(0.5 * (u0 + u1), v));
            }
        }
        sum / LINES as f64
    }

    fn patch_corners(&self, patch: &Patch) -> [Vec3; 4] {
        patch.0.map(|c| c.view)
    }
}
