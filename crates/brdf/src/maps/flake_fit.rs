//! The fit of a flake map: linear least squares with a smoothness term, solved at once.
//!
//! ```text
//! Σ_m w_m (y_m − Σ_k P_k c_k)² + λ Σ_k Σ_nodes (second differences of c_k along both axes)² → min
//! ```
//!
//! w_m is the solid angle over `(σ dy/df)² + τ_y²`: τ, the error of the map itself, keeps exact data from counting without limit. The smoothness
//! term fills nodes without data, and alone decides there. The unknowns of a node stand together, so the matrix is a band and is factorised
//! directly. Of a cell mean the equation is the mean over the cell; that y is curved over f is put right from the map itself, fit by fit.

use gonio_optics::{Angle, Vec3, quadrature};

use super::{
    FitError, FlakeFitOptions, FlakeMap, Region, Sample, Transform,
    finding::Finding,
    flake_choice::choose,
    flake_point::{FlakePoint, single},
    flake_rows::{Datum, Row, Shape, solve},
};
use crate::{Flag, Meaning, Measured, average::CellBounds};

/// Gauss–Legendre nodes across a cell, each way.
const ACROSS: usize = 3;
/// Fits after the first that put the curved scale right.
const REFITS: usize = 2;
/// Below this share of covered nodes within the region a map says so.
const WELL_COVERED: f64 = 0.5;
/// A channel that is negative in more than this share of the measurements is meant so.
const OUTSIDE: f64 = 0.1;
/// With fewer measurements than this a map has at most `SPARSE_NODES`: more would be filled by smoothness alone, and worse.
const SPARSE: usize = 1000;
const SPARSE_NODES: [usize; 2] = [16, 32];
/// How much better than with a coat measurements must be predicted without one before the map says so.
const NOT_SEEN: f64 = 1.25;

impl FlakeMap {
    /// Fits a map to samples.
    ///
    /// # Errors
    /// [`FitError`]: an option outside its bounds, too few samples, or no solution.
    pub fn fit(name: &str, samples: &[Sample], options: &FlakeFitOptions) -> Result<Self, FitError> {
        let taking = samples.iter().filter(|s| options.region.contains(s.light, s.view));
        Self::fit_data(name, &taking.copied().map(Datum::node).collect::<Vec<_>>(), options)
    }

    /// Fits a map to the measured cells of a table (filled and extrapolated ones are left out), weighted by their solid angle and σ. Cell means are
    /// met by means of the map over the cell.
    ///
    /// # Errors
    /// [`FitError`]: an option outside its bounds, too few cells, or no solution.
    pub fn fit_table(name: &str, table: &Measured, options: &FlakeFitOptions) -> Result<Self, FitError> {
        Self::fit_data(name, &cells(table, options.region), options)
    }

    fn fit_data(name: &str, data: &[Datum], options: &FlakeFitOptions) -> Result<Self, FitError> {
        options.check()?;
        let mut options = *options;
        let mut findings = Vec::new();
        if options.harmonics > 0
            && !data.is_empty()
            && data.iter().all(|d| in_plane(&d.sample, options.index))
        {
            findings.push(Finding::AllInPlane { asked: options.harmonics });
            options.harmonics = 0;
        }
        if data.len() < SPARSE {
            options.nodes = [0, 1].map(|a| options.nodes[a].min(SPARSE_NODES[a]));
        }
        let least = 3 * (options.harmonics + 1);
        if data.len() < least {
            return Err(FitError::Data {
                found: data.len(),
                expected: least,
                largest_deg: options.region.largest.degrees(),
                mirror_deg: options.region.from_mirror.degrees(),
            });
        }
        let choice = choose(data, &options);
        let shape = Shape::of(&options);
        let mut rows: Vec<Row> = data.iter().map(|d| Row::new(d, &shape, choice.edge)).collect();
        let means = data.iter().any(|d| d.points.len() > 1);
        let mut coefficients = Vec::new();
        for _ in 0..=if means { REFITS } else { 0 } {
            if !coefficients.is_empty() {
                rows.iter_mut().for_each(|r| r.unbend(&shape, &coefficients));
            }
            coefficients = solve(rows.iter(), &shape, choice.smoothness)
                .ok_or(FitError::Singular { smoothness: choice.smoothness })?;
        }
        let mut covered = vec![false; shape.count()];
        for &(m, share) in rows.iter().flat_map(|r| &r.used) {
            covered[m / shape.terms] |= share != 0.0 && m.is_multiple_of(shape.terms);
        }
        if let Some(ratio) = choice.against_none.filter(|r| *r > NOT_SEEN) {
            findings.push(Finding::CoatNotSeen { index: options.index, ratio });
        }
        let bounds = bounds(&rows, options.transform);
        let mut map = Self {
            name: name.to_owned(),
            index: options.index,
            harmonics: options.harmonics,
            nodes: options.nodes,
            transform: options.transform,
            edge: choice.edge,
            region: options.region,
            bounds,
            coefficients: coefficients.iter().map(|c| [c[0] as f32, c[1] as f32, c[2] as f32, 0.0]).collect(),
            covered,
            sigma: None,
            findings,
        };
        let share = map.covered_share();
        if share < WELL_COVERED {
            map.findings.push(Finding::MostlyContinued { covered: share });
        }
        Ok(map)
    }

    /// Share of the region's geometries, by solid angle, with measurements beside them.
    #[must_use]
    pub fn covered_share(&self) -> f64 {
        const COUNT: usize = 2000;
        let covered = self.region.directions(COUNT, 0).filter(|&(l, v)| self.covers(l, v)).count();
        covered as f64 / COUNT as f64
    }
}

/// Smallest and largest y of each channel.
fn bounds(rows: &[Row], transform: Transform) -> [[f32; 4]; 2] {
    let of = |c: usize| {
        let y = || rows.iter().map(|r| r.y[c]);
        let (low, high) = (y().fold(f64::INFINITY, f64::min), y().fold(f64::NEG_INFINITY, f64::max));
        // noise about zero is no negative reflectance; a colour outside the primaries has a channel that is negative throughout
        let outside = y().filter(|y| *y < 0.0).count() as f64 > OUTSIDE * rows.len() as f64;
        let low = if transform == Transform::CubeRoot && !outside { low.max(0.0) } else { low };
        [low as f32, high.max(low) as f32]
    };
    let [r, g, b] = [of(0), of(1), of(2)];
    [0, 1].map(|end| [r[end], g[end], b[end], 0.0])
}

/// Whether P_k is that of φ_d = 0 within a few parts in a thousand, for all k.
fn in_plane(s: &Sample, index: f64) -> bool {
    let p = FlakePoint::new(single(s.light), single(s.view), (1.0 / index) as f32);
    let [first, square] = p.first_harmonic();
    square.sqrt() - first < 0.005
}

/// The measured cells of a table within the region.
fn cells(table: &Measured, region: Region) -> Vec<Datum> {
    let Meaning::CellMean { lamp_half_angle } = table.meaning else {
        return region.of_table(table).into_iter().map(Datum::node).collect();
    };
    let rule = quadrature::gauss_legendre(ACROSS);
    let mut data = Vec::new();
    for (i, flag) in table.flag.iter().enumerate() {
        let cell = table.grid.coordinates(i);
        let Some(sample) = region.of_cell(table, i).filter(|_| *flag == Flag::Measured) else { continue };
        let b = CellBounds::of(&table.grid, lamp_half_angle, cell);
        let (ca, cb) = (b.theta_o.0.cos(), b.theta_o.1.cos());
        let mut points = Vec::with_capacity(ACROSS * ACROSS);
        for &(x, wx) in &rule {
            for &(y, wy) in &rule {
                let theta = Angle::from_radians((ca + (cb - ca) * x).clamp(-1.0, 1.0).acos());
                let phi = b.phi.0 + (b.phi.1 - b.phi.0) * y;
                points.push((sample.light, Vec3::from_polar(theta, phi), wx * wy));
            }
        }
        data.push(Datum { sample, points });
    }
    data
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maps::flake_map::place;
    use gonio_optics::flake::flake_angles;

    #[test]
    fn the_corners_of_a_place_hold_it() {
        for (l, v) in Region::default().directions(500, 1) {
            let p = FlakePoint::new(single(l), single(v), 1.0 / 1.5);
            let (corner, share) = place(&p, 1.5, [40, 30]);
            let a = flake_angles(l, v, 1.5);
            let (inc, flake) = (1.5 * a.theta_inc.sin() * 39.0, (1.5 * a.theta_flake.sin()).sqrt() * 29.0);
            let mean = |f: fn(usize) -> usize| {
                corner.iter().zip(share).map(|(c, s)| f(*c) as f64 * f64::from(s)).sum::<f64>()
            };
            assert!((mean(|c| c / 30) - inc).abs() < 1e-3 && (mean(|c| c % 30) - flake).abs() < 1e-3);
        }
    }
}
