//! The local geometries that a picture is made of: for each pixel the directions of light and view in the sample's frame, and what each adds per unit of f.
//!
//! With these lists a picture is `L = Σ w f(l, v)`: made again for any reflectance without tracing, the same rays for all, so that the difference of two
//! pictures holds no noise. Light straight from the lamps, no coat's mirror image. What weight a geometry has in the picture is read off the same lists.

use gonio_brdf::Rgb;
use gonio_optics::{Geometry, Vec3, colour};
use rayon::prelude::*;

use super::lobe::Mixture;
use super::picture::{camera_ray, nothing_visible};
use super::sequence::Sequence;
use super::shade::{Shader, Vertex};
use crate::scene::{Scene, SceneError};
use crate::sphere::LinearImage;

/// A single-precision direction, z the normal.
pub type Direction = [f32; 3];

/// Evaluates many geometries: lights, views, and where f goes.
pub type Evaluate<'a> = &'a (dyn Fn(&[Direction], &[Direction], &mut [[f32; 3]]) + Sync);

/// The lists, all views one after the other, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Gathered {
    /// Pixels across and down.
    pub size: [u32; 2],
    /// Number of views.
    pub views: usize,
    /// Entries of pixel k are `starts[k]..starts[k + 1]`.
    pub starts: Vec<usize>,
    /// Towards the light.
    pub lights: Vec<Direction>,
    /// Towards the viewer.
    pub toward: Vec<Direction>,
    /// Radiance per unit of f.
    pub weights: Vec<[f32; 3]>,
    /// Share of each pixel that the object covers.
    pub coverage: Vec<f32>,
    /// Radiance that counts as white.
    pub white: f64,
}

/// Writes down the geometries of every view. `sharpness` is that of the sharpest reflectance that will be asked for; it steers where environments are drawn.
///
/// # Errors
/// [`SceneError::NothingVisible`] where no view shows the object, [`SceneError::Dark`] where no light reaches it.
pub fn gather(scene: &Scene, sharpness: f64, cosine: bool) -> Result<Gathered, SceneError> {
    let [wide, high] = scene.size;
    let mixture = Mixture::new(sharpness);
    let mut out = Gathered {
        size: scene.size,
        views: scene.views.len(),
        starts: vec![0],
        lights: Vec::new(),
        toward: Vec::new(),
        weights: Vec::new(),
        coverage: Vec::new(),
        white: scene.white(),
    };
    for view in &scene.views {
        let shader = Shader { scene, view, mixture, cosine };
        let rows: Vec<Vec<Pixel>> = (0..high)
            .into_par_iter()
            .map(|row| (0..wide).map(|col| Pixel::of(&shader, [col, row])).collect())
            .collect();
        for pixel in rows.into_iter().flatten() {
            out.coverage.push(pixel.coverage);
            for (l, v, w) in pixel.entries {
                out.lights.push(single(l));
                out.toward.push(single(v));
                out.weights.push(w.map(|x| x as f32));
            }
            out.starts.push(out.lights.len());
        }
    }
    if out.coverage.iter().all(|c| *c == 0.0) {
        return Err(scene.views.first().map_or(SceneError::Dark, |v| nothing_visible(scene, v)));
    }
    if out.weights.iter().flatten().all(|w| *w <= 0.0) {
        return Err(SceneError::Dark);
    }
    Ok(out)
}

struct Pixel {
    coverage: f32,
    entries: Vec<(Vec3, Vec3, Rgb)>,
}

impl Pixel {
    fn of(s: &Shader<'_>, at: [u32; 2]) -> Self {
        let scene = s.scene;
        let place = u64::from(at[1]) * u64::from(scene.size[0]) + u64::from(at[0]);
        let mut covered = 0u32;
        let mut entries = Vec::new();
        for index in 0..scene.samples {
            let mut numbers = Sequence::new(place, index, scene.samples);
            let (from, direction) = camera_ray(scene, s.view, at, numbers.pair());
            let Some(hit) = scene.body.hit(from, direction) else { continue };
            covered += 1;
            let v = Vertex::new(&hit, direction);
            s.lamps(&v, &mut numbers, &mut |l, w| entries.push((l, v.view, w)));
            if s.environments().next().is_some()
                && let Some(drawn) = s.draw(&v, &mut numbers)
                && !scene.body.blocks(v.leave(&scene.body), drawn.world, f64::INFINITY)
            {
                entries.push((drawn.local, v.view, s.escaped(&drawn)));
            }
        }
        // the mean over what is covered, as pictures are
        let n = f64::from(covered.max(1));
        entries.iter_mut().for_each(|e| e.2 = e.2.map(|w| w / n));
        Self { coverage: (f64::from(covered) / f64::from(scene.samples)) as f32, entries }
    }
}

fn single(d: Vec3) -> Direction {
    d.to_array().map(|x| x as f32)
}

fn double(d: Direction) -> Vec3 {
    let [x, y, z] = d.map(f64::from);
    Vec3::new(x, y, z)
}

/// Bins of the distribution, degrees in θi, θo and φ.
const BINS: [f64; 3] = [2.5, 2.5, 5.0];

impl Gathered {
    /// The pictures of all views for a reflectance.
    #[must_use]
    pub fn pictures(&self, evaluate: Evaluate<'_>) -> Vec<LinearImage> {
        let pixels = self.size[0] as usize * self.size[1] as usize;
        let mut f = vec![[0.0f32; 3]; self.lights.len()];
        let piece = 4096;
        f.par_chunks_mut(piece).enumerate().for_each(|(k, out)| {
            let range = k * piece..k * piece + out.len();
            evaluate(&self.lights[range.clone()], &self.toward[range], out);
        });
        let value = |p: usize| {
            let mut sum = [0.0f64; 3];
            let range = self.starts[p]..self.starts[p + 1];
            for (f, w) in f[range.clone()].iter().zip(&self.weights[range]) {
                for c in 0..3 {
                    sum[c] += f64::from(f[c]) * f64::from(w[c]);
                }
            }
            sum.map(|x| x as f32)
        };
        (0..self.views)
            .map(|v| {
                let range = v * pixels..(v + 1) * pixels;
                LinearImage {
                    width: self.size[0],
                    height: self.size[1],
                    values: range.clone().map(value).collect(),
                    coverage: self.coverage[range].to_vec(),
                }
            })
            .collect()
    }

    /// Share of every entry in its pixel's light (luminance), times the pixel's coverage: the weights of a scene, each lit pixel counting alike.
    fn shares(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (0..self.coverage.len()).flat_map(move |p| {
            let range = self.starts[p]..self.starts[p + 1];
            let light = |i: usize| colour::luminance(self.weights[i].map(f64::from)).max(0.0);
            let total: f64 = range.clone().map(light).sum();
            let cover = f64::from(self.coverage[p]);
            range.filter(move |_| total > 0.0).map(move |i| (i, cover * light(i) / total))
        })
    }

    /// The local geometries with their weights, which sum to 1, in bins of 2.5°, 2.5° and 5°: one mean geometry for each bin met.
    #[must_use]
    pub fn geometries(&self) -> Vec<(Geometry, f64)> {
        let mut bins: std::collections::BTreeMap<[u16; 3], [f64; 4]> = std::collections::BTreeMap::new();
        let mut total = 0.0;
        for (i, w) in self.shares() {
            let g = Geometry::from_directions(double(self.lights[i]), double(self.toward[i]));
            let angles = [g.theta_i, g.theta_o, g.phi].map(|a| a.degrees());
            let key = [0, 1, 2].map(|k| (angles[k] / BINS[k]).clamp(0.0, 1000.0) as u16);
            let bin = bins.entry(key).or_default();
            for k in 0..3 {
                bin[k] += w * angles[k];
            }
            bin[3] += w;
            total += w;
        }
        bins.into_values()
            .filter(|b| b[3] > 0.0)
            .map(|b| (Geometry::from_degrees(b[0] / b[3], b[1] / b[3], b[2] / b[3]), b[3] / total))
            .collect()
    }

    /// Share of each pixel's light that comes from geometries for which `met` holds, all views one after the other; 0 where none comes.
    #[must_use]
    pub fn share_of(&self, met: &(dyn Fn(Vec3, Vec3) -> bool + Sync)) -> Vec<f64> {
        let mut out = vec![0.0; self.coverage.len()];
        for (p, share) in out.iter_mut().enumerate() {
            let (mut part, mut all) = (0.0, 0.0);
            for i in self.starts[p]..self.starts[p + 1] {
                let w = colour::luminance(self.weights[i].map(f64::from)).max(0.0);
                all += w;
                part += if met(double(self.lights[i]), double(self.toward[i])) { w } else { 0.0 };
            }
            *share = if all > 0.0 { part / all } else { 0.0 };
        }
        out
    }
}
