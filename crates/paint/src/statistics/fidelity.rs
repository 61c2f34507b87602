//! How far statistics are from the textures they were taken of.

use rayon::prelude::*;

use super::lab::{brdf_from_lab, lab_from_brdf_lanes};
use super::{Cluster, FlakeStatistics, RandomTexture};
use crate::FlakeBtf;

/// What sparkles: texels whose lightness stands out from their slice.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sparkle {
    /// Share of texels more than three standard deviations above the slice's mean L* (threshold of the original for both).
    pub density: f64,
    /// Mean Y of these over the mean Y of the slice; 0 where nothing sparkles.
    pub contrast: f64,
}

/// One slice against its reconstruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SliceFidelity {
    /// Largest difference of the means of L*, a*, b*.
    pub mean: f64,
    /// Largest relative difference of the standard deviations of L*, a*, b* (axes that spread less than 0.05 left out).
    pub deviation: f64,
    /// Mean over the axes of the distance (Wasserstein 1) between the distributions of L*, of a* and of b*, Lab units.
    pub distance: f64,
    /// Relative difference of the mean Y.
    pub luminance: f64,
    /// Sparkle of the original.
    pub original: Sparkle,
    /// Sparkle of the reconstruction.
    pub rebuilt: Sparkle,
}

/// All slices against their reconstruction by the shared random texture.
#[derive(Clone, Debug, PartialEq)]
pub struct Fidelity {
    /// Each slice.
    pub slices: Vec<SliceFidelity>,
    /// Bytes of the textures in single precision.
    pub raw_bytes: usize,
    /// Bytes of the statistics.
    pub bytes: usize,
}

impl Fidelity {
    /// Mean over the slices of one of their numbers.
    #[must_use]
    pub fn mean(&self, of: impl Fn(&SliceFidelity) -> f64) -> f64 {
        self.slices.iter().map(of).sum::<f64>() / self.slices.len() as f64
    }

    /// Largest of one of their numbers.
    #[must_use]
    pub fn largest(&self, of: impl Fn(&SliceFidelity) -> f64) -> f64 {
        self.slices.iter().map(of).fold(0.0, f64::max)
    }
}

/// Compares textures with what the statistics draw, texture for texture.
#[must_use]
pub fn fidelity(btf: &FlakeBtf, statistics: &FlakeStatistics) -> Fidelity {
    let slices: Vec<&[[f32; 3]]> = btf.slices().collect();
    let [width, height] = btf.size();
    let compared = slices
        .par_iter()
        .enumerate()
        .map(|(k, original)| {
            let rebuilt = statistics.texture(k as u32, [width, height], RandomTexture::shared());
            compare(original, &rebuilt)
        })
        .collect();
    Fidelity { slices: compared, raw_bytes: slices.len() * width * height * 12, bytes: statistics.bytes() }
}

fn axes(texels: &[[f32; 3]]) -> [Vec<f32>; 3] {
    let mut lab = [0; 3].map(|_| vec![0.0; texels.len()]);
    let [l, a, b] = &mut lab;
    lab_from_brdf_lanes(texels, [l, a, b]);
    lab
}

fn mean_and_deviation(values: &[f32]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
    let variance = values.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / n;
    [mean, variance.sqrt()]
}

fn luminance(texel: &[f32; 3]) -> f64 {
    gonio_optics::colour::luminance(texel.map(f64::from))
}

fn mean_luminance(texels: &[[f32; 3]]) -> f64 {
    texels.iter().map(luminance).sum::<f64>() / texels.len() as f64
}

/// Texels of equal number compared as distributions.
pub(crate) fn compare(original: &[[f32; 3]], rebuilt: &[[f32; 3]]) -> SliceFidelity {
    let (mut p, mut q) = (axes(original), axes(rebuilt));
    let (mut mean, mut deviation) = (0.0_f64, 0.0_f64);
    for c in 0..3 {
        let ([m, s], [m1, s1]) = (mean_and_deviation(&p[c]), mean_and_deviation(&q[c]));
        mean = mean.max((m1 - m).abs());
        if s > 0.05 {
            deviation = deviation.max((s1 / s - 1.0).abs());
        }
    }
    let [m, s] = mean_and_deviation(&p[0]);
    let threshold = m + 3.0 * s;
    let sparkle = |texels: &[[f32; 3]], lightness: &[f32]| {
        let (mut count, mut sum) = (0.0, 0.0);
        for (t, l) in texels.iter().zip(lightness) {
            if f64::from(*l) > threshold {
                count += 1.0;
                sum += luminance(t);
            }
        }
        let contrast = if count > 0.0 { sum / count / mean_luminance(texels) } else { 0.0 };
        Sparkle { density: count / texels.len() as f64, contrast }
    };
    let (was, is) = (sparkle(original, &p[0]), sparkle(rebuilt, &q[0]));
    let mut distance = 0.0;
    for c in 0..3 {
        p[c].sort_by(f32::total_cmp);
        q[c].sort_by(f32::total_cmp);
        let sum: f64 = p[c].iter().zip(&q[c]).map(|(x, y)| f64::from((x - y).abs())).sum();
        distance += sum / p[c].len() as f64 / 3.0;
    }
    let y = mean_luminance(original);
    let luminance = if y > 0.0 { (mean_luminance(rebuilt) / y - 1.0).abs() } else { 0.0 };
    SliceFidelity { mean, deviation, distance, luminance, original: was, rebuilt: is }
}

/// Mean colour (1/sr) of a box, colours uniform in Lab.
///
/// Where all of the box lies on the cube curve, `E[(c + u + v)³] = c³ + c (p² + q²)` for u, v uniform in ±p, ±q; else three Gauss points on each axis.
pub(super) fn mean_colour(cluster: &Cluster) -> [f64; 3] {
    let centre = cluster.centre();
    let half = [0, 1, 2].map(|c: usize| 0.5 * (f64::from(cluster.high[c]) - f64::from(cluster.low[c])).abs());
    let y = (centre[0] + 16.0) / 116.0;
    let (p, qa, qb) = (half[0] / 116.0, half[1] / 500.0, half[2] / 200.0);
    let (x, z) = (y + centre[1] / 500.0, y - centre[2] / 200.0);
    if (x - p - qa).min(y - p).min(z - p - qb) > 6.0 / 29.0 {
        let cube = |c: f64, q: f64| c * c * c + c * (p * p + q * q);
        let xyz = [cube(x, qa), cube(y, 0.0), cube(z, qb)];
        let white = gonio_optics::colour::D65_WHITE;
        let rgb =
            gonio_optics::colour::rgb_from_xyz([xyz[0] * white[0], xyz[1] * white[1], xyz[2] * white[2]]);
        return rgb.map(|c| c / std::f64::consts::PI);
    }
    gauss_mean(centre, half)
}

fn gauss_mean(centre: [f64; 3], half: [f64; 3]) -> [f64; 3] {
    // √(3/5) and weights 5/18, 8/18
    const NODES: [f64; 3] = [-0.774_596_669_241_483_4, 0.0, 0.774_596_669_241_483_4];
    const WEIGHTS: [f64; 3] = [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0];
    let mut sum = [0.0; 3];
    for (x, wx) in NODES.iter().zip(WEIGHTS) {
        for (y, wy) in NODES.iter().zip(WEIGHTS) {
            for (z, wz) in NODES.iter().zip(WEIGHTS) {
                let lab = [centre[0] + x * half[0], centre[1] + y * half[1], centre[2] + z * half[2]];
                let colour = brdf_from_lab(lab);
                for c in 0..3 {
                    sum[c] += wx * wy * wz * colour[c];
                }
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_a_box_in_closed_form_is_that_of_quadrature() {
        let cluster = Cluster { low: [20.0, -30.0, 5.0], high: [90.0, 40.0, 50.0], steps: 1 };
        let (a, b) = (mean_colour(&cluster), gauss_mean(cluster.centre(), [35.0, 35.0, 22.5]));
        assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-12), "{a:?} {b:?}");
    }
}
