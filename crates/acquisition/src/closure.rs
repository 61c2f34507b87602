//! Closure checks: laws that a measurement must keep whatever was measured, each with what it gives, what its uncertainty lets expect, and a verdict.
//!
//! * Reciprocity: `f(a, b, φ) = f(b, a, φ)` for angles that occur both as θi and as θo.
//! * The white reference's law of cos θi: each of its poses gives every pixel the same scale.
//! * Black glass follows Fresnel's reflectance over θi.
//! * The first pose, taken once more at the end, gives what it gave.
//! * The sample, taken off and put back, gives what it gave.
//!
//! A check that departs does not say what is wrong, but that the stated uncertainty is.

use gonio_brdf::{Flag, Measured};
use gonio_optics::{Angle, fresnel};

use crate::cells::Cell;
use crate::coat::Gloss;
use crate::lamp::Scatter;
use crate::reference::WhiteReference;
use crate::robust::{SIGMA_OF_MEDIAN, median};

/// Cells nearer to the mirror direction take no part: there a lobe changes within a cell.
const MIRROR_DEG: f64 = 15.0;
/// Fewest pairs of a comparison.
const LEAST: usize = 10;
/// How many times the expected a value may be.
const MARGIN: f64 = 2.0;
/// How many standard uncertainties the worst of a few poses may be off.
const WORST: f64 = 3.5;
/// What of the estimate of a cell's curvature is taken as its own uncertainty.
const CURVATURE: f64 = 0.3;

/// What a check says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The law holds within its uncertainty.
    Agrees,
    /// It does not.
    Departs,
    /// There was nothing to check it by.
    NotChecked,
}

impl Verdict {
    /// In a word, for files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Departs => "departs",
            Self::NotChecked => "not-checked",
        }
    }
}

/// One check.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// Its name.
    pub name: &'static str,
    /// What was found, relative.
    pub value: Option<f64>,
    /// What its standard uncertainty lets expect, relative.
    pub expected: Option<f64>,
    /// The verdict.
    pub verdict: Verdict,
    /// What was compared with what; or what would have been needed.
    pub words: String,
}

impl Check {
    fn of(name: &'static str, value: f64, expected: f64, agrees: bool, words: String) -> Self {
        let verdict = if agrees { Verdict::Agrees } else { Verdict::Departs };
        Self { name, value: Some(value), expected: Some(expected), verdict, words }
    }

    fn not(name: &'static str, words: impl Into<String>) -> Self {
        Self { name, value: None, expected: None, verdict: Verdict::NotChecked, words: words.into() }
    }
}

/// Names of the checks, in the order of a report.
pub const NAMES: [&str; 5] = ["reciprocity", "white-cosine", "black-glass", "first-pose", "remounting"];

/// σ without what the whole table shares.
fn own_sigma(m: &Measured, i: usize, c: usize) -> f64 {
    let shared = m.sigma_parts.get("certificate").map_or(0.0, |p| f64::from(p[i][c]));
    (f64::from(m.sigma[i][c]).powi(2) - shared * shared).max(0.0).sqrt()
}

fn beyond_mirror(m: &Measured, i: usize) -> bool {
    let [ti, to, phi] = m.grid.coordinates(i);
    let (light, view) = m.grid.geometry(ti, to, phi).directions();
    let mirror = gonio_optics::Vec3::new(-light.x, -light.y, light.z);
    view.angle_to(mirror).degrees() > MIRROR_DEG
}

/// f at the node of a cell, from its mean and the second difference over θo: a mean over a bin of width h lies above by f″h²/24. With it that correction.
fn at_node(m: &Measured, i: usize, c: usize) -> (f64, f64) {
    let [ti, to, phi] = m.grid.coordinates(i);
    let f = f64::from(m.values[i][c]);
    let beside = |to: usize| {
        let k = m.grid.index(ti, to, phi);
        (m.flag[k] != Flag::Invalid).then(|| f64::from(m.values[k][c]))
    };
    let [_, no, _] = m.grid.shape();
    let bend = match (to.checked_sub(1).and_then(beside), (to + 1 < no).then(|| beside(to + 1)).flatten()) {
        (Some(a), Some(b)) => (a - 2.0 * f + b) / 24.0,
        _ => 0.0,
    };
    (f - bend, bend)
}

/// Reciprocity over the measured cells of a table.
#[must_use]
pub fn reciprocity(m: &Measured) -> Check {
    let name = NAMES[0];
    let grid = &m.grid;
    let [ni, _, np] = grid.shape();
    let place = |nodes: &[f64], deg: f64| nodes.iter().position(|n| (n - deg).abs() < 1e-9);
    let (mut differences, mut sigmas) = (Vec::new(), Vec::new());
    for a in 0..ni {
        for b in a + 1..ni {
            let (Some(to_b), Some(to_a)) = (
                place(&grid.theta_o_deg, grid.theta_i_deg[b]),
                place(&grid.theta_o_deg, grid.theta_i_deg[a]),
            ) else {
                continue;
            };
            for phi in 0..np {
                let (i, j) = (grid.index(a, to_b, phi), grid.index(b, to_a, phi));
                let measured = m.flag[i] == Flag::Measured && m.flag[j] == Flag::Measured;
                // the cap about the normal is one cell for all azimuths
                if !measured || to_a == 0 || !beyond_mirror(m, i) || !beyond_mirror(m, j) {
                    continue;
                }
                for c in 0..3 {
                    let ((f, u), (g, v)) = (at_node(m, i, c), at_node(m, j, c));
                    let mean = 0.5 * (f + g);
                    if mean > 0.0 {
                        differences.push(((f - g) / mean).abs());
                        let noise = own_sigma(m, i, c).hypot(own_sigma(m, j, c));
                        sigmas.push(noise.hypot(CURVATURE * u.hypot(v)) / mean);
                    }
                }
            }
        }
    }
    if differences.len() < LEAST {
        return Check::not(
            name,
            "no angles of incidence that are viewing angles of other poses too; scan at several tilts",
        );
    }
    let n = differences.len();
    let value = SIGMA_OF_MEDIAN * median(&mut differences).unwrap_or(0.0);
    let expected = median(&mut sigmas).unwrap_or(0.0);
    let words = format!(
        "f with light and view exchanged, {n} pairs of values beyond {MIRROR_DEG}° of the mirror direction, robust standard deviation"
    );
    Check::of(name, value, expected, value <= MARGIN * expected, words)
}

/// The law of cos θi by the white reference; `angle` is a direction's standard uncertainty, `lamp` how much the lamp's monitor scatters from pose to pose.
#[must_use]
pub fn white_cosine(white: &WhiteReference, angle: Angle, lamp: Scatter) -> Check {
    let name = NAMES[1];
    if white.law.len() < 2 {
        return Check::not(
            name,
            "the white reference has fewer than two poses that share pixels; scan it at more tilts",
        );
    }
    let each = white.law.iter().map(|l| {
        let tilt = Angle::from_degrees(l.theta_i_deg).tan().abs() * angle.radians();
        (
            l.departure,
            l.sigma.hypot(tilt).hypot(lamp.sigma).hypot(white.stray_relative).max(1e-9),
            l.theta_i_deg,
        )
    });
    let worst = each.max_by(|a, b| (a.0 / a.1).abs().total_cmp(&(b.0 / b.1).abs()));
    let (value, expected, at) = worst.unwrap_or((0.0, 1.0, 0.0));
    let words = format!(
        "the pose at θi = {at:.1}° against all {} of the white reference, median over its pixels",
        white.law.len()
    );
    Check::of(name, value.abs(), expected, value.abs() <= WORST * expected, words)
}

/// Fresnel's curve by black glass of an index; `common` is what all poses share, relative. Empty where no session of it was given.
#[must_use]
pub fn black_glass(gloss: &[Gloss], index: f64, common: f64) -> Check {
    let name = NAMES[2];
    let points: Vec<(f64, f64)> = gloss
        .iter()
        .filter_map(|g| {
            let f = g.reflectance.filter(|f| *f > 8.0 * g.sigma)?;
            let expected = fresnel::dielectric(g.theta_i.cos(), index);
            Some((f / expected - 1.0, (g.sigma / expected).hypot(2e-3)))
        })
        .collect();
    if points.len() < 3 {
        return Check::not(
            name,
            "no session of black glass with three poses that show its gloss among the references; give one with --reference",
        );
    }
    let rms = (points.iter().map(|p| p.0 * p.0).sum::<f64>() / points.len() as f64).sqrt();
    let own = (points.iter().map(|p| p.1 * p.1).sum::<f64>() / points.len() as f64).sqrt();
    let expected = own.hypot(common);
    let words = format!(
        "measured over Fresnel's reflectance (n = {index}) less 1, {} poses, root mean square",
        points.len()
    );
    Check::of(name, rms, expected, rms <= MARGIN * expected, words)
}

/// The first pose against itself at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeated {
    /// Median over the cells of last over first, less 1.
    pub departure: f64,
    /// Its standard uncertainty from the noise of the cells.
    pub sigma: f64,
    /// Cells compared.
    pub cells: usize,
}

/// Compares two poses cell by cell in green.
pub(crate) fn repeated(first: &[Option<Cell>], last: &[Option<Cell>]) -> Option<Repeated> {
    let (mut ratios, mut noise) = (Vec::new(), 0.0);
    for (a, b) in first.iter().zip(last) {
        let (Some(a), Some(b)) = (a, b) else { continue };
        if a.value[1] > 0.0 {
            ratios.push(b.value[1] / a.value[1] - 1.0);
            noise += (a.shot[1] + a.read[1] + b.shot[1] + b.read[1]) / (a.value[1] * a.value[1]);
        }
    }
    let n = ratios.len();
    (n >= LEAST).then(|| Repeated {
        departure: median(&mut ratios).unwrap_or(0.0),
        sigma: 1.25 * (noise / n as f64).sqrt() / (n as f64).sqrt(),
        cells: n,
    })
}

/// The verdict on that; `lamp` is the scatter of the lamp's monitor from pose to pose.
#[must_use]
pub fn first_pose(found: Option<Repeated>, lamp: f64) -> Check {
    let name = NAMES[3];
    let Some(r) = found else {
        return Check::not(
            name,
            "the plan does not take its first pose again at the end; say repeat_first = true in it",
        );
    };
    let expected = r.sigma.hypot(lamp * std::f64::consts::SQRT_2);
    let words = format!("the first pose against the same at the end, median over {} cells", r.cells);
    Check::of(name, r.departure.abs(), expected, r.departure.abs() <= WORST * expected.max(1e-9), words)
}

/// Tables of one sample put on the holder anew each time.
#[must_use]
pub fn remounting(tables: &[&Measured]) -> Check {
    let name = NAMES[4];
    let Some((first, others)) = tables.split_first().filter(|(_, o)| !o.is_empty()) else {
        return Check::not(name, "one session; give those of the sample put on again with --remount");
    };
    if others.iter().any(|t| t.grid != first.grid) {
        return Check::not(name, "the sessions' tables have different grids");
    }
    let (mut spreads, mut sigmas) = (Vec::new(), Vec::new());
    for i in (0..first.flag.len()).filter(|&i| beyond_mirror(first, i)) {
        if tables.iter().any(|t| t.flag[i] != Flag::Measured) {
            continue;
        }
        let n = tables.len() as f64;
        let mean = tables.iter().map(|t| f64::from(t.values[i][1])).sum::<f64>() / n;
        if mean <= 0.0 {
            continue;
        }
        let square =
            tables.iter().map(|t| (f64::from(t.values[i][1]) - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let sigma = tables.iter().map(|t| own_sigma(t, i, 1).powi(2)).sum::<f64>() / n;
        spreads.push(square / (mean * mean));
        sigmas.push(sigma / (mean * mean));
    }
    if spreads.len() < LEAST {
        return Check::not(name, "the sessions share too few measured cells");
    }
    let n = spreads.len();
    let rms = |v: &[f64]| (v.iter().sum::<f64>() / n as f64).sqrt();
    let (value, expected) = (rms(&spreads), rms(&sigmas));
    let words = format!(
        "standard deviation over {} sessions, {n} cells beyond {MIRROR_DEG}° of the mirror direction, root mean square",
        tables.len()
    );
    Check::of(name, value, expected, value <= MARGIN * expected, words)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::models::Lambert;
    use gonio_brdf::{Brdf, Grid};

    fn table(brdf: &dyn Brdf, relative: f32) -> Measured {
        let mut m = Measured::sampled(Grid::sopp(), brdf);
        m.flag.fill(Flag::Measured);
        m.sigma = m.values.iter().map(|v| v.map(|f| relative * f)).collect();
        m
    }

    /// Noise of `relative` by cell, in no order that swapping light and view keeps: SplitMix64's bits, twelve of them added up.
    fn shaken(mut m: Measured, relative: f32, seed: u64) -> Measured {
        for (i, v) in m.values.iter_mut().enumerate() {
            let mut z = (i as u64 ^ (seed << 32)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            let normal = ((z >> 40) as u32 & 0xfff).count_ones() as f32 - 6.0;
            let factor = 1.0 + relative * normal / 3f32.sqrt();
            *v = v.map(|f| f * factor);
        }
        m
    }

    #[test]
    fn a_reciprocal_table_agrees_and_one_that_is_not_departs() {
        let white = Lambert { diffuse: [0.5; 3] };
        let good = reciprocity(&shaken(table(&white, 0.01), 0.01, 1));
        assert_eq!(good.verdict, Verdict::Agrees, "{good:?}");
        let worse = reciprocity(&shaken(table(&white, 0.01), 0.05, 1));
        assert_eq!(worse.verdict, Verdict::Departs, "{worse:?}");
        // the light's cosine in it, the view's not
        let mut bent = table(&white, 0.002);
        for i in 0..bent.flag.len() {
            let [ti, _, _] = bent.grid.coordinates(i);
            let factor = bent.grid.theta_i_deg[ti].to_radians().cos() as f32;
            bent.values[i] = bent.values[i].map(|f| f * (0.5 + 0.5 * factor));
        }
        assert_eq!(reciprocity(&bent).verdict, Verdict::Departs);
        let empty = Measured::empty(Grid::sopp(), gonio_brdf::Meaning::Node);
        assert_eq!(reciprocity(&empty).verdict, Verdict::NotChecked);
    }

    #[test]
    fn remounting_is_held_against_the_stated_noise() {
        let white = Lambert { diffuse: [0.5; 3] };
        let of = |r: f32, seed| shaken(table(&white, 0.01), r, seed);
        let (a, b, c) = (of(0.01, 1), of(0.01, 2), of(0.04, 3));
        assert_eq!(remounting(&[&a, &b]).verdict, Verdict::Agrees, "{:?}", remounting(&[&a, &b]));
        assert_eq!(remounting(&[&a, &b, &c]).verdict, Verdict::Departs);
        assert_eq!(remounting(&[&a]).verdict, Verdict::NotChecked);
    }

    #[test]
    fn a_first_pose_that_comes_back_brighter_departs() {
        let cell = |f: f64| Some(Cell { value: [f; 3], shot: [1e-6; 3], ..Cell::default() });
        let first: Vec<_> = (0..100).map(|_| cell(0.1)).collect();
        let same: Vec<_> = (0..100).map(|k| cell(0.1 + if k % 2 == 0 { 1e-3 } else { -1e-3 })).collect();
        let brighter: Vec<_> = (0..100).map(|_| cell(0.103)).collect();
        let verdict = |last: &[Option<Cell>]| first_pose(repeated(&first, last), 1e-3).verdict;
        assert_eq!(verdict(&brighter), Verdict::Departs);
        assert_eq!(first_pose(repeated(&first, &same), 1e-2).verdict, Verdict::Agrees);
        assert_eq!(first_pose(None, 0.0).verdict, Verdict::NotChecked);
    }
}
