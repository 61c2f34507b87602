//! What one pose shows of light that went astray, tile by tile of the filter pattern, in green.
//!
//! Tiles well away from every pixel that sees the sample are dark by nature; in a white session they show `g mean + ε K∗x`. About the mirror image of the
//! lamp on black glass all that shows is the tail, an even level, and what the camera's own face sends to the glass, which reflects it as Fresnel has it;
//! level and face have an amount of their own in each pose, and what these can explain is taken off both sides.

use gonio_optics::fresnel;

use super::distance;
use super::stray::{Tiles, tiles};
use crate::merge::Merged;
use crate::pixel_map::{PixelMap, PoseView};

/// Tiles about a gloss that belong to it beyond the lamp's image.
const GLOSS_MARGIN: usize = 2;
/// Tiles out to which the surroundings of a gloss are looked at.
const GLOSS_REACH: usize = 40;
/// Largest θo of a pixel whose share of the face's light is known, degrees: beyond, footprints reach far past what is lit.
const FACE_LIMIT_DEG: f64 = 75.0;
/// A tile that differs from the model by more than so many standard deviations, and by half of it, is no tile without light of its own.
const STRANGE: f64 = 5.0;
/// Rounds in which the light before it went astray is found: (g + ε)³ of it is left open.
const ROUNDS: usize = 3;

/// One pose.
#[derive(Clone, Debug)]
pub struct Evidence {
    seen: Tiles,
    /// Variance of each tile.
    variance: Vec<f64>,
    /// Relative standard deviation of the tiles' sensitivities, which noise does not hold.
    response: f64,
    /// Places of the tiles that take part.
    pub(super) at: Vec<usize>,
    /// Light besides, whose amount is free: one shape after the other, a number for each tile of `at`.
    free: Vec<Vec<f64>>,
}

/// A tile: what the model gives for g = 1 and ε = 1 and how it changes with ln σ, what is seen, its weight.
pub struct Row {
    /// Its place.
    pub tile: usize,
    /// By g, ε and ln σ.
    pub model: [f64; 3],
    /// Electrons per second.
    pub seen: f64,
    /// Inverse variance.
    pub weight: f64,
}

fn green(merged: &[Merged], map: &PixelMap) -> (Tiles, Vec<f64>) {
    let [_, seen, _] = tiles(map, |p| f64::from(merged[p].rate));
    let [_, variance, _] = tiles(map, |p| f64::from(merged[p].shot + merged[p].read + merged[p].dark));
    // the mean of two pixels
    (seen, variance.values.into_iter().map(|v| 0.5 * v).collect())
}

impl Evidence {
    /// The blind pixels of a pose of a diffuse sample; haze is taken off already. `response` is the relative standard deviation of pixels' sensitivities.
    #[must_use]
    pub fn of_blind(merged: &[Merged], view: &PoseView, map: &PixelMap, response: f64) -> Self {
        let (seen, variance) = green(merged, map);
        let margin = distance::margin(map);
        let far = distance::of_tiles(map, |p| view.visible[p]);
        let at = (0..far.len()).filter(|&i| far[i] >= margin && variance[i] > 0.0).collect();
        Self { seen, variance, response: response / std::f64::consts::SQRT_2, at, free: Vec::new() }
    }

    /// The surroundings of the gloss of black glass of this index; `None` where no gloss stands out.
    #[must_use]
    pub fn of_gloss(
        merged: &[Merged],
        view: &PoseView,
        map: &PixelMap,
        response: f64,
        index: f64,
    ) -> Option<Self> {
        let (seen, variance) = green(merged, map);
        let w = seen.width;
        let brightest = (0..seen.values.len()).max_by(|&a, &b| seen.values[a].total_cmp(&seen.values[b]))?;
        let (x0, y0) = (brightest % w, brightest / w);
        if seen.values[brightest] < 100.0 * seen.mean().max(1.0) {
            return None;
        }
        let pixel = 2 * y0 * map.width() + 2 * x0;
        let pitch = map.solid_angle(pixel).sqrt().max(1e-6);
        let inner =
            (map.description().lamp.half_angle().radians() / pitch * 0.5).ceil() as usize + GLOSS_MARGIN;
        // a gloss that is cut off by the picture's edge, or whose pixels are saturated throughout, has lost light
        let whole = x0 >= inner && y0 >= inner && x0 + inner < w && y0 + inner < seen.height;
        let lost = (0..merged.len()).any(|p| {
            let (x, y) = (p % map.width() / 2, p / map.width() / 2);
            x.abs_diff(x0) <= inner && y.abs_diff(y0) <= inner && merged[p].rate == f32::INFINITY
        });
        if !whole || lost {
            return None;
        }
        let face = face_on_glass(view, map, index);
        let at: Vec<usize> = (0..seen.values.len())
            .filter(|&i| {
                let d = (i % w).abs_diff(x0).pow(2) + (i / w).abs_diff(y0).pow(2);
                d > inner * inner
                    && d <= (inner + GLOSS_REACH).pow(2)
                    && variance[i] > 0.0
                    && face[i].is_finite()
            })
            .collect();
        let free = vec![vec![1.0; at.len()], at.iter().map(|&i| face[i]).collect()];
        Some(Self { seen, variance, response: response / std::f64::consts::SQRT_2, at, free })
    }

    /// Whether it is of a gloss.
    #[must_use]
    pub const fn is_of_gloss(&self) -> bool {
        !self.free.is_empty()
    }

    /// Tiles of the picture, across and down.
    pub(super) const fn size(&self) -> [usize; 2] {
        [self.seen.width, self.seen.height]
    }

    /// Drops tiles that see light of their own after all: edges that are not where they should be.
    pub(super) fn without_strangers(&mut self, shares: [f64; 2], sigma: f64) {
        if self.is_of_gloss() {
            return;
        }
        let (mean, tails) = (self.seen.mean(), self.seen.tails(sigma));
        let (seen, variance) = (&self.seen, &self.variance);
        self.at.retain(|&i| {
            let model = shares[0] * mean + shares[1] * tails.values[i];
            (seen.values[i] - model).abs() <= 0.5 * model.abs() + STRANGE * variance[i].sqrt()
        });
    }

    /// Drops tiles whose residual is beyond so many standard deviations of theirs: unknown dead pixels.
    pub(super) fn without_outliers(&mut self, shares: [f64; 2], sigma: f64, bound: f64) {
        let rows = self.rows(shares, sigma, None);
        let near: Vec<bool> = rows
            .iter()
            .map(|r| {
                (r.seen - shares[0] * r.model[0] - shares[1] * r.model[1]).abs() * r.weight.sqrt() <= bound
            })
            .collect();
        let kept =
            |v: &[f64]| -> Vec<f64> { v.iter().zip(&near).filter(|(_, n)| **n).map(|(v, _)| *v).collect() };
        self.free.iter_mut().for_each(|shape| *shape = kept(shape));
        let mut near = near.iter();
        self.at.retain(|_| near.next().is_none_or(|n| *n));
    }

    /// What is seen over the picture's mean, and what the model says, tile by tile.
    pub(super) fn against(&self, shares: [f64; 2], sigma: f64) -> Vec<[f64; 2]> {
        let (mean, tails) = (self.seen.mean(), self.seen.tails(sigma));
        let model = |i: usize| (shares[0] * mean + shares[1] * tails.values[i]) / mean;
        self.at.iter().map(|&i| [model(i), self.seen.values[i] / mean]).collect()
    }

    /// Its tiles at shares and a width (tiles). `step` is that of ln σ for the derivative, which is zero without it.
    pub(super) fn rows(&self, shares: [f64; 2], sigma: f64, step: Option<f64>) -> Vec<Row> {
        // the light before it went astray, by the shares known so far
        let kept = 1.0 - shares[0] - shares[1];
        let mut x = self.seen.clone();
        if shares != [0.0; 2] {
            for _ in 0..ROUNDS {
                let (mean, tails) = (x.mean(), x.tails(sigma));
                for ((x, y), t) in x.values.iter_mut().zip(&self.seen.values).zip(&tails.values) {
                    *x = (y - shares[0] * mean - shares[1] * t) / kept;
                }
            }
            // what is dark by nature is dark
            if !self.is_of_gloss() {
                self.at.iter().for_each(|&i| x.values[i] = 0.0);
            }
        }
        let (mean, tails) = (x.mean(), x.tails(sigma));
        let slope =
            step.map(|h| (x.tails(sigma * h.exp()), x.tails(sigma * (-h).exp()), shares[1] / (2.0 * h)));
        let mut rows: Vec<Row> = self
            .at
            .iter()
            .map(|&i| {
                let seen = self.seen.values[i];
                let by_width = slope.as_ref().map_or(0.0, |(a, b, f)| f * (a.values[i] - b.values[i]));
                Row {
                    tile: i,
                    model: [mean, tails.values[i], by_width],
                    seen,
                    weight: 1.0 / (self.variance[i] + (self.response * seen).powi(2)).max(1e-12),
                }
            })
            .collect();
        self.take_off_free(&mut rows);
        rows
    }

    /// Takes off model and seen alike what the free shapes explain of them.
    fn take_off_free(&self, rows: &mut [Row]) {
        let mut shapes: Vec<Vec<f64>> = Vec::new();
        let dot = |rows: &[Row], a: &dyn Fn(usize, &Row) -> f64, b: &[f64]| -> f64 {
            rows.iter().enumerate().map(|(k, r)| r.weight * a(k, r) * b[k]).sum()
        };
        for shape in &self.free {
            let mut own = shape.clone();
            let before = dot(rows, &|k, _| own[k], &own);
            for other in &shapes {
                let along = dot(rows, &|k, _| own[k], other);
                own.iter_mut().zip(other).for_each(|(o, s)| *o -= along * s);
            }
            let norm = dot(rows, &|k, _| own[k], &own);
            // a shape that is even over these tiles is no shape of its own
            if norm > 1e-6 * before {
                let scale = norm.sqrt().recip();
                own.iter_mut().for_each(|o| *o *= scale);
                shapes.push(own);
            }
        }
        for s in &shapes {
            let along = [0, 1, 2].map(|c| dot(rows, &|_, r| r.model[c], s));
            let level = dot(rows, &|_, r| r.seen, s);
            for (k, r) in rows.iter_mut().enumerate() {
                (0..3).for_each(|c| r.model[c] -= along[c] * s[k]);
                r.seen -= level * s[k];
            }
        }
    }
}

/// What black glass shows of the camera's face, in shape: Fresnel's reflectance times étendue and lit share of the footprint, 0 where nothing of the glass
/// is seen, NaN where that is not known tile by tile.
fn face_on_glass(view: &PoseView, map: &PixelMap, index: f64) -> Vec<f64> {
    let w = map.width();
    let limit = FACE_LIMIT_DEG.to_radians().cos();
    let blind = distance::of_tiles(map, |p| view.visible[p]);
    let sighted = distance::of_tiles(map, |p| !view.visible[p]);
    let margin = distance::margin(map);
    (0..blind.len())
        .map(|i| {
            let (x, y) = (2 * (i % (w / 2)), 2 * (i / (w / 2)));
            let p = y * w + x;
            let v = view.sample_from_lab.apply(map.direction(p));
            if blind[i] >= margin {
                0.0
            } else if sighted[i] >= margin && v.z > limit {
                let lit = map.lit_share(p, &view.sample_from_lab, view.theta_i.cos());
                let seen =
                    map.optics().etendue((x + 1) as f64, (y + 1) as f64) * fresnel::dielectric(v.z, index);
                // nor is it where it is not known how much of it is lit
                if lit > 0.0 { seen * lit } else { f64::NAN }
            } else {
                f64::NAN
            }
        })
        .collect()
}
