//! The sample turned under the light: is it the same at every spin, and what is it if not.
//!
//! Cells are kept apart by azimuth φi of the light on the sample (spin s puts it at −s) and by side of the plane of incidence. A sample without a grain gives the same
//! value at every φi and on both sides. What differs beyond noise is either flakes, which are other flakes at each spin and vary with it at random, or a grain,
//! which varies smoothly: f(φi) = a0 + a2 cos 2φi + b2 sin 2φi + …. Of N values that vary at random the two terms explain 2/(N − 1) of the variance; of a grain
//! they explain most.

use std::collections::BTreeMap;

use gonio_brdf::anisotropic::both_sides;
use gonio_brdf::{Anisotropic, Flag, Grid, Meaning};

use crate::cells::Cell;

/// Spins from which on flakes and grain can be told apart.
const ENOUGH: usize = 6;
/// Variation, relative to f, below which a sample counts as without a grain whatever causes it.
const SMALL: f64 = 0.01;

/// What was seen from one side of the plane of incidence at one azimuth, summed over poses.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    n: u16,
    value: [f32; 3],
    variance: [f32; 3],
}

impl Seen {
    /// Mean over the poses and its variance.
    fn mean(&self, c: usize) -> Option<(f64, f64)> {
        let n = f64::from(self.n);
        (self.n > 0).then(|| (f64::from(self.value[c]) / n, f64::from(self.variance[c]) / (n * n)))
    }
}

/// Cells by azimuth of the light and side; sides of a row run (φ ≥ 0: θo, φ), then (φ < 0: θo, |φ|).
#[derive(Clone, Debug, Default)]
pub struct Azimuths {
    /// By thousandths of a degree of φi, then row θi.
    turns: BTreeMap<i64, BTreeMap<usize, Vec<Seen>>>,
}

/// What turning the sample shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Isotropy {
    /// Azimuths of the light, at the row that has most.
    pub spins: usize,
    /// Variation over spins and sides beyond noise, r.m.s. over cells, relative to f.
    pub variation: f64,
    /// What noise alone makes, likewise.
    pub noise: f64,
    /// Share of the variance over spins that cos 2φi and sin 2φi explain; `None` for too few spins.
    pub smooth: Option<f64>,
    /// The same of values that vary at random.
    pub smooth_by_chance: f64,
    /// What follows.
    pub verdict: Grain,
}

/// Whether a sample has a grain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grain {
    /// The same at every spin, give or take noise.
    None,
    /// Varies at random from spin to spin.
    Flakes,
    /// Varies smoothly with spin.
    Anisotropic,
    /// Varies, and too few spins tell why.
    Undecided,
}

impl Grain {
    /// Name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "isotropic",
            Self::Flakes => "isotropic, with flakes",
            Self::Anisotropic => "anisotropic",
            Self::Undecided => "undecided",
        }
    }
}

impl Isotropy {
    /// The finding in a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        let (v, n) = (100.0 * self.variation, 100.0 * self.noise);
        let over = match self.spins {
            1 => "the two sides of the plane of incidence differ".to_owned(),
            s => format!("{s} spins and both sides of the plane of incidence differ"),
        };
        match self.verdict {
            Grain::None => format!("{over} by {v:.2} % beyond noise of {n:.2} %: isotropic"),
            Grain::Flakes => format!(
                "{over} by {v:.2} % beyond noise of {n:.2} %, at random from spin to spin: flakes, isotropic on average"
            ),
            Grain::Anisotropic => format!(
                "{over} by {v:.2} % beyond noise of {n:.2} %, {:.0} % of it smoothly with the spin (by chance {:.0} %): anisotropic",
                100.0 * self.smooth.unwrap_or_default(),
                100.0 * self.smooth_by_chance
            ),
            Grain::Undecided => format!(
                "{over} by {v:.2} % beyond noise of {n:.2} %: flakes, or a sample that looks different when turned; {ENOUGH} spins over 180° or more would tell"
            ),
        }
    }
}

/// Sums of a weighted mean.
#[derive(Default)]
struct Mean {
    sum: f64,
    weight: f64,
}

impl Mean {
    fn add(&mut self, value: f64, weight: f64) {
        self.sum += weight * value;
        self.weight += weight;
    }

    fn get(&self) -> f64 {
        if self.weight > 0.0 { self.sum / self.weight } else { 0.0 }
    }
}

impl Azimuths {
    /// Adds a pose of row `ti` with the light at azimuth `phi_i_deg`; `sides` are the cells of either side.
    pub(crate) fn add(&mut self, ti: usize, phi_i_deg: f64, sides: &[Option<Cell>]) {
        let key = ((phi_i_deg.rem_euclid(360.0) * 1e3).round() as i64).rem_euclid(360_000);
        let row = self.turns.entry(key).or_default().entry(ti).or_default();
        row.resize(sides.len(), Seen::default());
        for (s, cell) in row.iter_mut().zip(sides) {
            let Some(cell) = cell else { continue };
            s.n = s.n.saturating_add(1);
            for c in 0..3 {
                s.value[c] += cell.value[c] as f32;
                // what the white reference and the dark frames add is the same at every spin
                s.variance[c] += (cell.shot[c] + cell.read[c]) as f32;
            }
        }
    }

    /// Azimuths of the light, degrees.
    fn azimuths_deg(&self) -> Vec<f64> {
        self.turns.keys().map(|&k| k as f64 * 1e-3).collect()
    }

    /// What turning shows; `None` before anything was seen.
    #[must_use]
    pub fn isotropy(&self, grid: &Grid, limit_deg: f64) -> Option<Isotropy> {
        let azimuths = self.azimuths_deg();
        let cells = grid.theta_o_deg.len() * grid.phi_deg.len();
        let (mut variation, mut noise, mut smooth) = (Mean::default(), Mean::default(), Mean::default());
        let (mut spins, mut rows) = (0, 0usize);
        for ti in 0..grid.theta_i_deg.len() {
            let turns: Vec<(f64, &Vec<Seen>)> = azimuths
                .iter()
                .zip(self.turns.values())
                .filter_map(|(a, rows)| rows.get(&ti).map(|r| (*a, r)))
                .collect();
            spins = spins.max(turns.len());
            rows += usize::from(!turns.is_empty());
            for cell in 0..cells {
                let (to, phi) = (cell / grid.phi_deg.len(), cell % grid.phi_deg.len());
                if grid.theta_o_deg[to] > limit_deg
                    // one cap has no sides; beside the mirror direction half a degree decides what is seen
                    || to == 0
                    || grid.geometry(ti, to, phi).from_mirror().degrees() <= 15.0
                {
                    continue;
                }
                let weight = grid.solid_angle(to, phi);
                for c in 0..3 {
                    // both sides at every azimuth: all of them the same for a sample without a grain
                    let all: Vec<(f64, f64)> = turns
                        .iter()
                        .flat_map(|(_, row)| [cell, cells + cell].map(|k| row.get(k).and_then(|s| s.mean(c))))
                        .flatten()
                        .collect();
                    let Some((mean, spread, expected)) = scatter(&all) else { continue };
                    variation.add((spread - expected) / (mean * mean), weight);
                    noise.add(expected / (mean * mean), weight);
                    for side in [cell, cells + cell] {
                        let series: Vec<(f64, f64)> = turns
                            .iter()
                            .filter_map(|(a, row)| Some((*a, row.get(side)?.mean(c)?.0)))
                            .collect();
                        if let Some((total, explained)) = second_harmonic(&series) {
                            smooth.add(explained / total, weight * total / (mean * mean));
                        }
                    }
                }
            }
        }
        if variation.weight <= 0.0 {
            return None;
        }
        let by_chance = 2.0 / (spins.max(3) - 1) as f64;
        let enough = spins >= ENOUGH;
        let mut out = Isotropy {
            spins,
            variation: variation.get().max(0.0).sqrt(),
            noise: noise.get().sqrt(),
            smooth: enough.then(|| smooth.get()),
            smooth_by_chance: by_chance,
            verdict: Grain::None,
        };
        // the share scatters over what is independent of each other: a few places a row; three times that is no chance
        let chance = by_chance + 3.0 * (by_chance * (1.0 - by_chance) / (4.0 * rows.max(1) as f64)).sqrt();
        out.verdict = match out.smooth {
            _ if out.variation <= SMALL.max(out.noise) => Grain::None,
            Some(share) if share > chance => Grain::Anisotropic,
            Some(_) => Grain::Flakes,
            None => Grain::Undecided,
        };
        Some(out)
    }

    /// The table over four angles; cells that were not seen, or lie beyond the limit, are invalid. `common` is the relative uncertainty that all values share.
    #[must_use]
    pub fn table(&self, grid: &Grid, meaning: Meaning, limit_deg: f64, common: f64) -> Anisotropic {
        let cells = grid.theta_o_deg.len() * grid.phi_deg.len();
        let whole = Grid { phi_deg: both_sides(&grid.phi_deg), ..grid.clone() };
        let mut t = Anisotropic::empty(self.azimuths_deg(), whole, meaning);
        for (pi, rows) in self.turns.values().enumerate() {
            for (&ti, row) in rows {
                for to in (0..t.grid.theta_o_deg.len()).filter(|&to| grid.theta_o_deg[to] <= limit_deg) {
                    for p in 0..t.grid.phi_deg.len() {
                        let turned = t.grid.phi_deg[p];
                        let folded = turned.min(360.0 - turned);
                        let phi = grid.phi_deg.partition_point(|&x| x < folded - 1e-9);
                        let cell = to * grid.phi_deg.len() + phi;
                        // in the plane of incidence, and at the cap, both sides are one
                        let both = folded.min(180.0 - folded) < 1e-9 || to == 0;
                        let sides = [turned <= 180.0 || both, turned > 180.0 || both];
                        let seen: Vec<&Seen> = [cell, cells + cell]
                            .iter()
                            .zip(sides)
                            .filter(|(_, used)| *used)
                            .filter_map(|(&k, _)| row.get(k).filter(|s| s.n > 0))
                            .collect();
                        if seen.is_empty() {
                            continue;
                        }
                        let at = pi * t.grid.len() + t.grid.index(ti, to, p);
                        let n = seen.len() as f64;
                        t.flag[at] = Flag::Measured;
                        for c in 0..3 {
                            let parts: Vec<(f64, f64)> = seen.iter().filter_map(|s| s.mean(c)).collect();
                            let mean = parts.iter().map(|p| p.0).sum::<f64>() / n;
                            let variance = parts.iter().map(|p| p.1).sum::<f64>() / (n * n);
                            t.values[at][c] = mean as f32;
                            t.sigma[at][c] = (variance + (common * mean).powi(2)).sqrt() as f32;
                        }
                    }
                }
            }
        }
        t
    }
}

/// Mean, variance of the values and what of it their own noise makes; `None` for fewer than two, or a mean that is not above its noise.
fn scatter(values: &[(f64, f64)]) -> Option<(f64, f64, f64)> {
    let n = values.len() as f64;
    if values.len() < 2 {
        return None;
    }
    let mean = values.iter().map(|v| v.0).sum::<f64>() / n;
    let spread = values.iter().map(|v| (v.0 - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let expected = values.iter().map(|v| v.1).sum::<f64>() / n;
    (mean > 3.0 * expected.sqrt() && mean > 0.0).then_some((mean, spread, expected))
}

/// Sum of squares about the mean, and what of it a + b cos 2φ + c sin 2φ explains (least squares); `None` where that cannot be told.
fn second_harmonic(series: &[(f64, f64)]) -> Option<(f64, f64)> {
    if series.len() < ENOUGH {
        return None;
    }
    let n = series.len() as f64;
    let mean = series.iter().map(|s| s.1).sum::<f64>() / n;
    let waves: Vec<[f64; 2]> = series
        .iter()
        .map(|s| {
            let (sin, cos) = (2.0 * s.0.to_radians()).sin_cos();
            [cos, sin]
        })
        .collect();
    let middle = [0, 1].map(|k| waves.iter().map(|w| w[k]).sum::<f64>() / n);
    let (mut a, mut right, mut total) = ([[0.0; 2]; 2], [0.0; 2], 0.0);
    for (s, w) in series.iter().zip(&waves) {
        let (d, w) = (s.1 - mean, [w[0] - middle[0], w[1] - middle[1]]);
        total += d * d;
        for i in 0..2 {
            right[i] += w[i] * d;
            for j in 0..2 {
                a[i][j] += w[i] * w[j];
            }
        }
    }
    let determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    // azimuths that do not tell cosine and sine apart
    if determinant <= 1e-3 * n * n || total <= 0.0 {
        return None;
    }
    let x = (right[0] * a[1][1] - right[1] * a[0][1]) / determinant;
    let y = (right[1] * a[0][0] - right[0] * a[1][0]) / determinant;
    Some((total, (x * right[0] + y * right[1]).clamp(0.0, total)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid {
            theta_i_deg: vec![0.0, 30.0],
            theta_o_deg: vec![0.0, 20.0, 40.0, 60.0],
            phi_deg: (0..7).map(|k| 30.0 * f64::from(k)).collect(),
        }
    }

    /// Noise by a hash, −1 … 1, of unit variance within a few per cent.
    fn chance(k: usize) -> f64 {
        let mut z = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// A sample f(φi, side, cell) with noise of 0.1 %.
    fn seen(spins: usize, f: impl Fn(f64, usize, usize) -> f64) -> Azimuths {
        let mut a = Azimuths::default();
        let cells = 28;
        for s in 0..spins {
            let phi_i = 360.0 / spins as f64 * s as f64;
            for ti in 0..2 {
                let sides: Vec<Option<Cell>> = (0..2 * cells)
                    .map(|k| {
                        let value = f(phi_i, k / cells, k % cells);
                        let noise = 1e-3 * value * 3f64.sqrt() * chance(s * 1000 + ti * 100 + k);
                        let variance = [(1e-3 * value).powi(2); 3];
                        (k != 40).then(|| Cell {
                            value: [value + noise; 3],
                            shot: variance,
                            ..Cell::default()
                        })
                    })
                    .collect();
                a.add(ti, phi_i, &sides);
            }
        }
        a
    }

    #[test]
    fn a_plain_sample_flakes_and_a_grain_are_told_apart() {
        let judged = |a: &Azimuths| a.isotropy(&grid(), 75.0).expect("seen");
        let plain = judged(&seen(12, |_, _, cell| 0.1 + cell as f64));
        assert_eq!(plain.verdict, Grain::None, "{}", plain.sentence());
        assert!((plain.noise - 1e-3).abs() < 1e-6 && plain.variation < 4e-4, "{plain:?}");
        let flakes = judged(&seen(12, |phi, side, cell| {
            0.5 + 0.1 * chance((phi * 7.0) as usize * 100 + side * 31 + cell)
        }));
        assert_eq!(flakes.verdict, Grain::Flakes, "{}", flakes.sentence());
        let brushed = judged(&seen(12, |phi, side, cell| {
            0.5 + 0.1 * (2.0 * phi.to_radians() + 0.3 * cell as f64 + side as f64).cos()
        }));
        assert_eq!(brushed.verdict, Grain::Anisotropic, "{}", brushed.sentence());
        assert!(
            brushed.smooth.expect("enough") > 0.95 && (brushed.variation - 0.14).abs() < 0.02,
            "{brushed:?}"
        );
    }

    #[test]
    fn few_spins_are_no_verdict_and_none_at_all_no_finding() {
        let one = seen(1, |_, side, _| 0.5 + 0.1 * side as f64).isotropy(&grid(), 75.0).expect("seen");
        assert_eq!((one.verdict, one.spins, one.smooth), (Grain::Undecided, 1, None));
        assert!(one.sentence().contains("6 spins"), "{}", one.sentence());
        let same = seen(1, |_, _, _| 0.5).isotropy(&grid(), 75.0).expect("seen");
        assert_eq!(same.verdict, Grain::None);
        assert!(Azimuths::default().isotropy(&grid(), 75.0).is_none());
    }

    #[test]
    fn the_table_holds_each_side_at_its_place() {
        let a = seen(4, |phi, side, cell| 1.0 + phi + 1000.0 * side as f64 + 10_000.0 * cell as f64);
        let t = a.table(&grid(), Meaning::Node, 45.0, 0.0);
        t.check().expect("sound");
        assert_eq!(t.phi_i_deg, [0.0, 90.0, 180.0, 270.0]);
        assert_eq!(t.grid.phi_deg.len(), 12);
        let value = |pi: usize, ti: usize, to: usize, p: usize| {
            let at = pi * t.grid.len() + t.grid.index(ti, to, p);
            (t.values[at][0], t.flag[at])
        };
        let near = |a: f32, b: f64| (f64::from(a) / b - 1.0).abs() < 5e-3;
        // φ = 60° on one side, 300° on the other
        assert!(near(value(1, 1, 2, 2).0, 1.0 + 90.0 + 160_000.0));
        assert!(near(value(1, 1, 2, 10).0, 1.0 + 90.0 + 1000.0 + 160_000.0));
        // in the plane of incidence the mean
        assert!(near(value(2, 0, 1, 0).0, 1.0 + 180.0 + 500.0 + 70_000.0));
        // never seen: side 1 of cell 12; beyond the limit: the last row
        assert_eq!(value(0, 0, 1, 7).1, Flag::Invalid);
        assert_eq!(value(0, 0, 3, 2).1, Flag::Invalid);
    }
}
