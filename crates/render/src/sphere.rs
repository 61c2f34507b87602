//! A ball made of a reflectance: what a paint looks like, without a renderer around it.
//!
//! Orthographic view along −z, lights at infinity, no shadows and no inter-reflection:
//! `L = Σ f(l, v) E cos θ`. Values are radiance factors `π L / E₀` with E₀ = 1, so that a perfect diffuser that faces a light of
//! irradiance 1 has the value 1.

mod known;
mod linear;
mod pair;

use gonio_brdf::{Brdf, Rgb};
use gonio_optics::{Vec3, quadrature};
use rayon::prelude::*;

pub use known::KnownCells;
pub use linear::{LinearImage, Tone};
pub use pair::{Lighting, SphereComparison, SphereDifference, Spheres, spheres};

/// A light at infinity. The viewer's frame: x to the right, y up, z towards the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// From one direction.
    Directional {
        /// Towards the light; any length above zero.
        towards: Vec3,
        /// Irradiance on a surface that faces it.
        irradiance: Rgb,
    },
    /// The same radiance from everywhere; the white furnace.
    Uniform {
        /// Irradiance on any surface, π times the radiance.
        irradiance: Rgb,
    },
}

impl Light {
    /// White, irradiance 1, at the viewer's place: every point is seen along its own light.
    #[must_use]
    pub const fn behind_detector() -> Self {
        Self::Directional { towards: Vec3::Z, irradiance: [1.0; 3] }
    }

    /// White, irradiance 1, from the left, 60° off the viewing direction and a little above.
    #[must_use]
    pub const fn aside() -> Self {
        Self::Directional { towards: Vec3::new(-0.8, 0.33, 0.5), irradiance: [1.0; 3] }
    }
}

/// How the ball is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct Sphere {
    /// Width and height of the image in pixels.
    pub size: u32,
    /// Samples per pixel along each side.
    pub samples: u32,
    /// Lights, added up.
    pub lights: Vec<Light>,
}

impl Default for Sphere {
    fn default() -> Self {
        Self { size: 256, samples: 2, lights: vec![Light::behind_detector()] }
    }
}

/// Share of the image's half width that the ball's radius takes.
pub const RADIUS: f64 = 0.94;

/// Point of the ball under a place in the image (−1…1, x to the right, y up): the unit normal in the viewer's frame, `None` beside the ball.
#[must_use]
pub fn normal_at(x: f64, y: f64) -> Option<Vec3> {
    let (x, y) = (x / RADIUS, y / RADIUS);
    let z2 = 1.0 - x * x - y * y;
    (z2 > 0.0).then(|| Vec3::new(x, y, z2.sqrt()))
}

/// Radiance factor that leaves the point with unit normal `n` towards the viewer. Not finite where the reflectance is not known.
#[must_use]
pub fn shade(brdf: &dyn Brdf, n: Vec3, lights: &[Light]) -> Rgb {
    let (t, b) = frame(n);
    let local = |d: Vec3| Vec3::new(d.dot(t), d.dot(b), d.dot(n));
    let view = local(Vec3::Z);
    let mut sum = [0.0; 3];
    let mut add = |light: Vec3, irradiance: Rgb, weight: f64| {
        if light.z > 0.0 {
            let f = brdf.eval(light, view);
            for c in 0..3 {
                sum[c] += std::f64::consts::PI * f[c] * irradiance[c] * light.z * weight;
            }
        }
    };
    for light in lights {
        match *light {
            Light::Directional { towards, irradiance } => add(local(towards.normalized()), irradiance, 1.0),
            Light::Uniform { irradiance } => {
                // cos θ dω = ½ d(sin² θ) dφ; the cosine is part of `add`, so it is divided out of the weight
                let rule = quadrature::gauss_legendre(12);
                for &(s2, w) in &rule {
                    let (s, z) = (s2.sqrt(), (1.0 - s2).sqrt());
                    for k in 0..24 {
                        let (sp, cp) = (std::f64::consts::TAU * (f64::from(k) + 0.5) / 24.0).sin_cos();
                        add(Vec3::new(s * cp, s * sp, z), irradiance, w / (24.0 * z));
                    }
                }
            }
        }
    }
    sum
}

/// Tangents along latitude and longitude, so that brushed metals would be brushed around the vertical axis.
fn frame(n: Vec3) -> (Vec3, Vec3) {
    let around = Vec3::new(n.z, 0.0, -n.x);
    let t = if around.norm() > 1e-9 { around.normalized() } else { Vec3::X };
    (t, n.cross(t))
}

/// Renders a ball on all cores; the result does not depend on their number.
#[must_use]
pub fn sphere(brdf: &dyn Brdf, options: &Sphere) -> LinearImage {
    let (size, n) = (options.size.clamp(1, 16_384), options.samples.clamp(1, 16));
    let pixel = |col: u32, row: u32| {
        let (mut sum, mut covered) = ([0.0; 3], 0u32);
        for s in 0..n * n {
            let fx = (f64::from(s % n) + 0.5) / f64::from(n);
            let fy = (f64::from(s / n) + 0.5) / f64::from(n);
            let x = 2.0 * (f64::from(col) + fx) / f64::from(size) - 1.0;
            let y = 1.0 - 2.0 * (f64::from(row) + fy) / f64::from(size);
            if let Some(normal) = normal_at(x, y) {
                covered += 1;
                let value = shade(brdf, normal, &options.lights);
                for c in 0..3 {
                    sum[c] += value[c];
                }
            }
        }
        // one unknown sample makes the pixel unknown: a mean over the rest would be biased
        let known = sum.iter().all(|v| v.is_finite());
        let mean = sum.map(|v| if known { (v / f64::from(covered.max(1))) as f32 } else { f32::NAN });
        (mean, (f64::from(covered) / f64::from(n * n)) as f32)
    };
    let rows: Vec<Vec<([f32; 3], f32)>> =
        (0..size).into_par_iter().map(|row| (0..size).map(|col| pixel(col, row)).collect()).collect();
    let (values, coverage) = rows.into_iter().flatten().unzip();
    LinearImage { width: size, height: size, values, coverage }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::models::{AshikhminShirleySimplified, Lambert};

    struct Unknown;
    impl Brdf for Unknown {
        fn eval(&self, _: Vec3, view: Vec3) -> Rgb {
            if view.z > 0.8 { [f64::NAN; 3] } else { [0.1; 3] }
        }
    }

    #[test]
    fn a_white_ball_in_a_white_furnace_cannot_be_seen() {
        let white = Lambert { diffuse: [1.0; 3] };
        let options = Sphere { size: 24, samples: 1, lights: vec![Light::Uniform { irradiance: [1.0; 3] }] };
        let image = sphere(&white, &options);
        let seen: Vec<_> = image.values.iter().zip(&image.coverage).filter(|p| *p.1 > 0.0).collect();
        assert!(seen.len() > 200);
        for (v, _) in seen {
            assert!(v.iter().all(|x| (x - 1.0).abs() < 1e-6), "{v:?}");
        }
    }

    #[test]
    fn a_diffuse_ball_follows_the_cosine_of_one_light() {
        let white = Lambert { diffuse: [1.0, 0.5, 0.25] };
        let light = Light::aside();
        let Light::Directional { towards, .. } = light else { unreachable!() };
        let size = 33;
        let image = sphere(&white, &Sphere { size, samples: 1, lights: vec![light] });
        for row in 0..size {
            for col in 0..size {
                let at = |k: u32| 2.0 * (f64::from(k) + 0.5) / f64::from(size) - 1.0;
                let Some(n) = normal_at(at(col), -at(row)) else { continue };
                let cos = n.dot(towards.normalized()).max(0.0);
                let v = image.values[(row * size + col) as usize];
                for (c, albedo) in [1.0, 0.5, 0.25].into_iter().enumerate() {
                    assert!((f64::from(v[c]) - albedo * cos).abs() < 1e-6, "{row} {col}: {v:?} {cos}");
                }
            }
        }
    }

    #[test]
    fn the_highlight_stands_where_the_mirror_law_puts_it() {
        let gloss = AshikhminShirleySimplified { diffuse: [0.1; 3], specular: [0.2; 3], exponent: 2000.0 };
        let size = 201;
        let image = sphere(&gloss, &Sphere { size, samples: 1, lights: vec![Light::aside()] });
        let brightest =
            (0..image.values.len()).max_by(|&a, &b| image.values[a][1].total_cmp(&image.values[b][1]));
        let at = brightest.unwrap() as u32;
        // the normal there halves the angle between light and viewer
        let half = (Vec3::new(-0.8, 0.33, 0.5).normalized() + Vec3::Z).normalized();
        let x = 2.0 * (f64::from(at % size) + 0.5) / f64::from(size) - 1.0;
        let y = 1.0 - 2.0 * (f64::from(at / size) + 0.5) / f64::from(size);
        assert!((x - half.x * RADIUS).hypot(y - half.y * RADIUS) < 0.03, "{x} {y} {half:?}");
    }

    #[test]
    fn what_is_not_known_is_marked_and_harms_nobody_else() {
        let image =
            sphere(&Unknown, &Sphere { size: 64, samples: 2, lights: vec![Light::behind_detector()] });
        let middle = image.values[(32 * 64 + 32) as usize];
        assert!(middle.iter().all(|v| v.is_nan()));
        assert!(image.missing() > 100);
        assert!(image.values.iter().filter(|v| v[0].is_finite() && v[0] > 0.0).count() > 500);
        let picture = image.to_picture(&Tone::default());
        assert_eq!((picture.width(), picture.height()), (64, 64));
    }

    #[test]
    fn the_same_ball_gives_the_same_pixels_on_any_number_of_threads() {
        let paint = AshikhminShirleySimplified { diffuse: [0.2; 3], specular: [0.1; 3], exponent: 50.0 };
        let options = Sphere { size: 48, ..Sphere::default() };
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let four = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
        assert_eq!(one.install(|| sphere(&paint, &options)), four.install(|| sphere(&paint, &options)));
    }
}
