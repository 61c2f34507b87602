//! Linearity: what the counts of a pixel do while its light grows by the clock.
//!
//! With x the counts above black over the range, d the same in the dark, T exposure times lamp and r a pixel's rate, the linearisation
//! `y(x) = x + c2 x² + c3 x³` is the one for which `y(x) − y(d) = r T` at every exposure. Pixels of one colour and like étendue are taken together
//! (their noise averages out, and grouping by what the lens does is blind to noise). The rates are eliminated group by group; what is left is
//! linear in c2, c3. Lamp and shutter err alike in all pixels of an exposure, so the covariance is that of exposures, not of pixels (a jackknife).

use nalgebra::{Matrix2, Vector2};

use super::RadiometryError;
use super::series::{Level, mean};
use crate::pixel_map::PixelMap;

/// Groups for each colour.
const GROUPS: usize = 48;
/// Share of the range up to which a group takes part: clipped noise would bend it.
pub(super) const USED: f64 = 0.94;
/// Relative error of an exposure that its monitor and clock do not tell.
const OWN_ERROR: f64 = 3e-4;
/// Bins of level in the record.
const BINS: usize = 20;

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Linearity {
    /// c1 = 1, c2, c3.
    pub coefficients: [f64; 3],
    /// Their covariance (of c2, c3).
    pub covariance: [[f64; 2]; 2],
    /// Level, departure before, departure after; shares of the range.
    pub levels: Vec<[f64; 3]>,
    /// Exposures used.
    pub exposures: usize,
}

impl Linearity {
    /// y of x.
    #[must_use]
    pub fn apply(&self, x: f64) -> f64 {
        let [a, b, c] = self.coefficients;
        x * (a + x * (b + x * c))
    }

    /// Standard uncertainty, by that of c2 and c3, of what changes with them by `by`.
    #[must_use]
    pub fn along(&self, [p, q]: [f64; 2]) -> f64 {
        let [[a, b], [_, c]] = self.covariance;
        (p * p * a + 2.0 * p * q * b + q * q * c).max(0.0).sqrt()
    }

    /// Relative uncertainty of light at the middle of the range against faint light: most exposures that count are about there.
    #[must_use]
    pub fn bend(&self) -> f64 {
        self.along([0.5, 0.25])
    }

    /// dy/dx.
    #[must_use]
    pub fn slope(&self, x: f64) -> f64 {
        let [a, b, c] = self.coefficients;
        a + x * (2.0 * b + x * 3.0 * c)
    }
}

/// Means over a group at one exposure: powers of x less those of d, the level, the light.
#[derive(Clone, Copy)]
struct Row {
    exposure: usize,
    powers: [f64; 3],
    level: f64,
    light: f64,
    weight: f64,
}

/// Finds the linearisation. `usable` marks pixels that see the sample and are neither hot nor dead; `black` is in counts, `electrons_per_count` need be
/// known to some tens of per cent only (it weighs).
///
/// # Errors
/// [`RadiometryError::Saturated`] where fewer than four exposures show unsaturated groups.
pub fn find(
    levels: &[Level<'_>],
    map: &PixelMap,
    usable: &[bool],
    black: f64,
    electrons_per_count: f64,
) -> Result<Linearity, RadiometryError> {
    let camera = &map.description().camera;
    let range = f64::from(camera.top_code() - camera.black_level);
    let groups = groups(map, usable);
    let mut rows: Vec<Vec<Row>> = vec![Vec::new(); groups.len()];
    let mut used = std::collections::BTreeSet::new();
    for (k, level) in levels.iter().enumerate() {
        let (lit, dark) = (mean(&level.lit, usable.len()), mean(&level.dark, usable.len()));
        for (rows, pixels) in rows.iter_mut().zip(&groups) {
            let (mut powers, mut x1) = ([0.0; 3], 0.0);
            for &p in pixels {
                let x = (f64::from(lit[p as usize]) - black) / range;
                let d = (f64::from(dark[p as usize]) - black) / range;
                x1 += x;
                for (j, sum) in powers.iter_mut().enumerate() {
                    *sum += x.powi(j as i32 + 1) - d.powi(j as i32 + 1);
                }
            }
            let n = pixels.len() as f64;
            let powers = powers.map(|s| s / n);
            let x = x1 / n;
            if x > USED || powers[0] <= 0.0 {
                continue;
            }
            let shot =
                x.max(0.0) / (range * electrons_per_count) + 9.0 / (range * electrons_per_count).powi(2);
            let variance = shot / (n * level.lit.len() as f64) + (OWN_ERROR * x).powi(2);
            rows.push(Row { exposure: k, powers, level: x, light: level.light_s(), weight: 1.0 / variance });
            used.insert(k);
        }
    }
    rows.retain(|r| r.len() >= 4);
    if used.len() < 4 || rows.is_empty() {
        return Err(RadiometryError::Saturated { exposures: levels.len(), usable: used.len() });
    }
    let (coefficients, covariance) = solve(&rows, levels.len());
    let levels = residuals(&rows, coefficients);
    Ok(Linearity { coefficients, covariance, levels, exposures: used.len() })
}

/// Pixels of one colour and like étendue.
fn groups(map: &PixelMap, usable: &[bool]) -> Vec<Vec<u32>> {
    let w = map.width();
    let mut out = Vec::new();
    for channel in 0..3 {
        let mut pixels: Vec<(f64, u32)> = (0..usable.len())
            .filter(|&p| usable[p] && map.channel(p) == channel)
            .map(|p| (map.optics().etendue((p % w) as f64 + 0.5, (p / w) as f64 + 0.5), p as u32))
            .collect();
        pixels.sort_by(|a, b| a.0.total_cmp(&b.0));
        let size = pixels.len().div_ceil(GROUPS).max(1);
        out.extend(pixels.chunks(size).map(|c| c.iter().map(|v| v.1).collect()));
    }
    out
}

/// What is left of a column when what a rate can explain is taken off.
fn projected(rows: &[Row], value: impl Fn(&Row) -> f64) -> Vec<f64> {
    let tt: f64 = rows.iter().map(|r| r.weight * r.light * r.light).sum();
    let tv: f64 = rows.iter().map(|r| r.weight * r.light * value(r)).sum();
    rows.iter().map(|r| value(r) - r.light * tv / tt).collect()
}

/// c2 and c3, without one of the exposures where one is named; `None` where the rest does not tell them.
fn coefficients(groups: &[Vec<Row>], without: Option<usize>) -> Option<Vector2<f64>> {
    let (mut n, mut b) = (Matrix2::<f64>::zeros(), Vector2::<f64>::zeros());
    for rows in groups {
        let rows: Vec<Row> = rows.iter().filter(|r| Some(r.exposure) != without).copied().collect();
        if rows.len() < 3 {
            continue;
        }
        let [x, q, c] = [0, 1, 2].map(|j| projected(&rows, |r| r.powers[j]));
        for (k, r) in rows.iter().enumerate() {
            let v = Vector2::new(q[k], c[k]);
            n += v * v.transpose() * r.weight;
            b -= v * (r.weight * x[k]);
        }
    }
    Some(n.try_inverse()? * b)
}

/// Coefficients and their covariance, by leaving out one exposure after the other: of so few exposures a sandwich would tell too little.
fn solve(groups: &[Vec<Row>], exposures: usize) -> ([f64; 3], [[f64; 2]; 2]) {
    let found = coefficients(groups, None).unwrap_or_else(Vector2::zeros);
    let seen = |k: &usize| groups.iter().flatten().any(|r| r.exposure == *k);
    let without: Vec<Vector2<f64>> =
        (0..exposures).filter(seen).filter_map(|k| coefficients(groups, Some(k))).collect();
    let n = without.len() as f64;
    let mean = without.iter().fold(Vector2::zeros(), |s: Vector2<f64>, v| s + v) / n.max(1.0);
    let spread =
        without.iter().map(|v| v - mean).fold(Matrix2::zeros(), |m: Matrix2<f64>, v| m + v * v.transpose());
    let covariance = spread * ((n - 1.0) / n.max(1.0));
    (
        [1.0, found[0], found[1]],
        [[covariance[(0, 0)], covariance[(0, 1)]], [covariance[(1, 0)], covariance[(1, 1)]]],
    )
}

/// Departures from each group's own straight line, by level.
fn residuals(groups: &[Vec<Row>], coefficients: [f64; 3]) -> Vec<[f64; 3]> {
    let mut bins = [[0.0; 4]; BINS];
    for rows in groups {
        let before = projected(rows, |r| r.powers[0]);
        let after = projected(rows, |r| (0..3).map(|j| coefficients[j] * r.powers[j]).sum());
        for (k, r) in rows.iter().enumerate() {
            let bin = &mut bins[((r.level.max(0.0) * BINS as f64) as usize).min(BINS - 1)];
            let terms = [1.0, r.level, before[k], after[k]];
            for (b, t) in bin.iter_mut().zip(terms) {
                *b += t;
            }
        }
    }
    bins.iter().filter(|b| b[0] > 0.0).map(|b| [b[1] / b[0], b[2] / b[0], b[3] / b[0]]).collect()
}
