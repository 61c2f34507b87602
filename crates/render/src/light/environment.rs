//! Light from all around: a map over the sphere of directions, drawn from in proportion to what it sends.
//!
//! Rows run from straight up to straight down, columns once around the vertical: they begin at −z and pass −x, +z and +x; what is behind a camera at +z
//! stands in the middle. Radiance is constant over a texel, so that a draw weighs exactly what its density says.

use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::sync::Arc;

use gonio_brdf::Rgb;
use gonio_optics::{Angle, Vec3, colour};

/// Skies that need no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sky {
    /// The same radiance 1 from everywhere: the white furnace.
    Uniform,
    /// CIE overcast: (1 + 2 sin height)/3 above the horizon, a grey floor of 0.1 below.
    Overcast,
    /// A dim room with a large soft light overhead and two strips at the sides.
    Studio,
}

/// A map of radiance. Copies share the texels.
#[derive(Clone, Debug)]
pub struct Environment {
    map: Arc<Map>,
    /// Turn about the vertical.
    turn: f64,
}

#[derive(Debug)]
struct Map {
    width: usize,
    height: usize,
    radiance: Vec<[f32; 3]>,
    /// Solid angle of a texel of each row.
    solid: Vec<f64>,
    /// Running sum of the chance of each row, then of each texel within its row.
    rows: Vec<f64>,
    texels: Vec<f64>,
    /// For sums over the whole sphere.
    blocks: Vec<(Vec3, Rgb)>,
}

impl Environment {
    /// From texels, row by row, and a factor on them. `None` where they do not fill the rectangle or one is negative or not finite.
    #[must_use]
    pub fn new(width: usize, height: usize, mut radiance: Vec<[f32; 3]>, factor: Rgb) -> Option<Self> {
        let fits = width > 0 && height > 0 && radiance.len() == width * height;
        for r in &mut radiance {
            *r = [0, 1, 2].map(|c| r[c] * factor[c] as f32);
        }
        if !fits || !radiance.iter().flatten().all(|x| x.is_finite() && *x >= 0.0) {
            return None;
        }
        let edge = |row: usize| (PI * row as f64 / height as f64).cos();
        let solid: Vec<f64> = (0..height).map(|r| TAU / width as f64 * (edge(r) - edge(r + 1))).collect();
        let light = |i: usize| colour::luminance(radiance[i].map(f64::from)) * solid[i / width];
        let total: f64 = (0..radiance.len()).map(light).sum();
        // a tenth goes everywhere alike: colours without luminance and rounding leave no texel without a chance
        let chance = |i: usize| {
            let even = solid[i / width] / (2.0 * TAU);
            if total > 0.0 { 0.9 * light(i) / total + 0.1 * even } else { even }
        };
        let (mut rows, mut texels, mut above) =
            (Vec::with_capacity(height), Vec::with_capacity(radiance.len()), 0.0);
        for r in 0..height {
            let mut sum = 0.0;
            for c in 0..width {
                sum += chance(r * width + c);
                texels.push(sum);
            }
            above += sum;
            rows.push(above);
        }
        let blocks = blocks(width, height, &radiance, &solid);
        Some(Self { map: Arc::new(Map { width, height, radiance, solid, rows, texels, blocks }), turn: 0.0 })
    }

    /// One of the skies, times `factor`.
    #[must_use]
    pub fn sky(sky: Sky, factor: Rgb) -> Self {
        let (width, height) = if sky == Sky::Uniform { (16, 8) } else { (128, 64) };
        let texel = |i: usize| {
            let theta = PI * ((i / width) as f64 + 0.5) / height as f64;
            let around = TAU * ((i % width) as f64 + 0.5) / width as f64;
            let up = theta.cos();
            let grey = match sky {
                Sky::Uniform => 1.0,
                Sky::Overcast => {
                    if up > 0.0 {
                        (1.0 + 2.0 * up) / 3.0
                    } else {
                        0.1
                    }
                }
                Sky::Studio => {
                    let within = |x: f64, middle: f64, half: f64| (x - middle).abs() <= half;
                    let (deg, turn) = (theta.to_degrees(), around.to_degrees());
                    if deg < 32.0 {
                        6.0
                    } else if within(deg, 68.0, 18.0)
                        && (within(turn, 118.0, 14.0) || within(turn, 262.0, 8.0))
                    {
                        4.0
                    } else if up > 0.0 {
                        0.25
                    } else {
                        0.12
                    }
                }
            };
            [grey as f32; 3]
        };
        // whole texels of finite light: always accepted
        Self::new(width, height, (0..width * height).map(texel).collect(), factor).unwrap_or_else(Self::black)
    }

    fn black() -> Self {
        let map = Map {
            width: 1,
            height: 1,
            radiance: vec![[0.0; 3]],
            solid: vec![2.0 * TAU],
            rows: vec![1.0],
            texels: vec![1.0],
            blocks: Vec::new(),
        };
        Self { map: Arc::new(map), turn: 0.0 }
    }

    /// Reads a latitude–longitude map in OpenEXR.
    ///
    /// # Errors
    /// What is wrong with the file, in words.
    pub fn open(path: &Path, factor: Rgb) -> Result<Self, String> {
        let create = |size: exr::prelude::Vec2<usize>, _: &exr::prelude::RgbaChannels| {
            (size, vec![[0.0f32; 3]; size.area()])
        };
        let set = |image: &mut (exr::prelude::Vec2<usize>, Vec<[f32; 3]>),
                   at: exr::prelude::Vec2<usize>,
                   (r, g, b, _): (f32, f32, f32, f32)| {
            let place = at.y() * image.0.x() + at.x();
            if let Some(p) = image.1.get_mut(place) {
                *p = [r, g, b];
            }
        };
        let read =
            exr::prelude::read_first_rgba_layer_from_file(path, create, set).map_err(|e| e.to_string())?;
        let (size, values) = read.layer_data.channel_data.pixels;
        Self::new(size.x(), size.y(), values, factor).ok_or_else(|| {
            format!("{} × {} texels of which some are negative or not finite", size.x(), size.y())
        })
    }

    /// Turned about the vertical.
    #[must_use]
    pub fn turned(&self, by: Angle) -> Self {
        Self { map: Arc::clone(&self.map), turn: self.turn + by.radians() }
    }

    fn texel(&self, d: Vec3) -> usize {
        let m = &*self.map;
        let theta = d.x.hypot(d.z).atan2(d.y);
        let around = ((-d.x).atan2(-d.z) - self.turn).rem_euclid(TAU);
        let row = ((theta / PI * m.height as f64) as usize).min(m.height - 1);
        let column = ((around / TAU * m.width as f64) as usize).min(m.width - 1);
        row * m.width + column
    }

    /// Radiance that comes from unit direction `d`.
    #[must_use]
    pub fn radiance(&self, d: Vec3) -> Rgb {
        self.map.radiance[self.texel(d)].map(f64::from)
    }

    /// Density per sr with which [`Self::draw`] gives `d`.
    #[must_use]
    pub fn density(&self, d: Vec3) -> f64 {
        self.density_of(self.texel(d))
    }

    fn density_of(&self, texel: usize) -> f64 {
        let m = &*self.map;
        let before = if texel.is_multiple_of(m.width) { 0.0 } else { m.texels[texel - 1] };
        (m.texels[texel] - before) / m.solid[texel / m.width]
    }

    /// A direction from two numbers in 0…1, its radiance and its density.
    #[must_use]
    pub fn draw(&self, u: f64, v: f64) -> (Vec3, Rgb, f64) {
        let m = &*self.map;
        let find = |sums: &[f64], u: f64| {
            let total = sums.last().copied().unwrap_or(1.0);
            let k = sums.partition_point(|s| *s <= u * total).min(sums.len().saturating_sub(1));
            let before = if k == 0 { 0.0 } else { sums[k - 1] };
            (k, ((u * total - before) / (sums[k] - before).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0))
        };
        let (row, fy) = find(&m.rows, u);
        let (column, fx) = find(&m.texels[row * m.width..(row + 1) * m.width], v);
        let edge = |r: usize| (PI * r as f64 / m.height as f64).cos();
        // even in solid angle within the texel
        let y = edge(row) + (edge(row + 1) - edge(row)) * fy;
        let around = TAU * (column as f64 + fx) / m.width as f64 + self.turn;
        let s = (1.0 - y * y).max(0.0).sqrt();
        let texel = row * m.width + column;
        let d = Vec3::new(-s * around.sin(), y, -s * around.cos());
        (d, m.radiance[texel].map(f64::from), self.density_of(texel))
    }

    /// Irradiance on a surface with unit normal `n`, summed over blocks of texels (64 × 32 at most).
    #[must_use]
    pub fn irradiance(&self, n: Vec3) -> Rgb {
        let (st, ct) = self.turn.sin_cos();
        let mut sum = [0.0; 3];
        for (d, light) in &self.map.blocks {
            // the block's direction turned about the vertical
            let turned = Vec3::new(d.x * ct + d.z * st, d.y, d.z * ct - d.x * st);
            let cos = turned.dot(n).max(0.0);
            for c in 0..3 {
                sum[c] += cos * light[c];
            }
        }
        sum
    }
}

/// Middle direction and radiance times solid angle of blocks of texels, at most 64 × 32.
fn blocks(width: usize, height: usize, radiance: &[[f32; 3]], solid: &[f64]) -> Vec<(Vec3, Rgb)> {
    let (bw, bh) = (width.div_ceil(64), height.div_ceil(32));
    let (columns, rows) = (width.div_ceil(bw), height.div_ceil(bh));
    let mut out = vec![(Vec3::ZERO, [0.0; 3]); columns * rows];
    for row in 0..height {
        let theta = PI * (row as f64 + 0.5) / height as f64;
        for column in 0..width {
            let around = TAU * (column as f64 + 0.5) / width as f64;
            let d = Vec3::new(-theta.sin() * around.sin(), theta.cos(), -theta.sin() * around.cos());
            let block = &mut out[row / bh * columns + column / bw];
            block.0 = block.0 + d;
            for (sum, l) in block.1.iter_mut().zip(radiance[row * width + column]) {
                *sum += f64::from(l) * solid[row];
            }
        }
    }
    out.into_iter().map(|(d, l)| (d.normalized(), l)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_and_densities_agree_and_sum_to_the_light_there_is() {
        let e = Environment::sky(Sky::Studio, [1.0, 0.8, 0.6]).turned(Angle::from_degrees(33.0));
        let (n, mut sum, mut whole) = (4000, 0.0, 0.0);
        let up = Vec3::new(0.2, 0.9, 0.3).normalized();
        for k in 0..n {
            let (u, v) = ((f64::from(k) + 0.5) / f64::from(n), (f64::from(k) * 0.618_033_988_75).fract());
            let (d, l, p) = e.draw(u, v);
            assert!((d.norm() - 1.0).abs() < 1e-9);
            assert!((p / e.density(d) - 1.0).abs() < 1e-9 && l == e.radiance(d), "{k} {p} {}", e.density(d));
            sum += l[0] * d.dot(up).max(0.0) / p;
            whole += 1.0 / p;
        }
        let (sum, whole) = (sum / f64::from(n), whole / f64::from(n));
        assert!((sum / e.irradiance(up)[0] - 1.0).abs() < 0.02, "{sum} {:?}", e.irradiance(up));
        assert!((whole / (2.0 * TAU) - 1.0).abs() < 0.1, "{whole}");
    }

    #[test]
    fn a_uniform_sky_gives_pi_on_every_side() {
        let e = Environment::sky(Sky::Uniform, [1.0; 3]);
        for n in [Vec3::X, Vec3::Y, Vec3::new(1.0, -2.0, 0.5).normalized()] {
            assert!((e.irradiance(n)[0] / PI - 1.0).abs() < 0.03, "{:?}", e.irradiance(n));
        }
        assert!(Environment::new(2, 1, vec![[0.0; 3], [f32::NAN; 3]], [1.0; 3]).is_none());
        assert!(Environment::new(2, 2, vec![[0.0; 3]], [1.0; 3]).is_none());
    }
}
