//! The fit of a flake map: linear least squares with a smoothness term, solved at once.
//!
//! ```text
//! Σ_m w_m (y_m − Σ_k P_k c_k)² + λ Σ_k Σ_nodes (second differences of c_k along both axes)² → min
//! ```
//!
//! w_m is the solid angle over `(σ/f)² + τ²`: τ, the error of the map itself, keeps exact data from counting without limit. The smoothness term
//! fills nodes without data, and alone decides there. The unknowns of a node stand together, so the matrix is a band and is factorised directly.

use super::{
    FlakeMap, Region, Sample, Transform,
    banded::Banded,
    flake_map::{MAX_HARMONICS, basis, place, transmittance},
    flake_point::{FlakePoint, single},
    transform::DARKEST,
};

/// How a map is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlakeFitOptions {
    /// Refractive index of the coat, 1 for none.
    pub index: f64,
    /// K, 0 to 3.
    pub harmonics: usize,
    /// Nodes over θ_inc and θ_flake, at least 4 each.
    pub nodes: [usize; 2],
    /// Scale on which errors count.
    pub transform: Transform,
    /// Whether T(θi)·T(θo) of the coat is divided out before the fit. Right for a diffuse base; of real paints it helps some and harms more,
    /// and from K = 1 on it makes no difference.
    pub transmittance: bool,
    /// λ, against a mean weight of 1 per node.
    pub smoothness: f64,
    /// τ, relative to f.
    pub own_error: f64,
    /// Samples elsewhere do not take part.
    pub region: Region,
}

impl Default for FlakeFitOptions {
    fn default() -> Self {
        Self {
            index: 1.5,
            harmonics: 1,
            nodes: [40, 40],
            transform: Transform::CubeRoot,
            transmittance: false,
            smoothness: 1e-3,
            own_error: 0.05,
            region: Region::default(),
        }
    }
}

/// A map that cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// An option outside its bounds.
    #[error("{option} = {found}: expected {expected}")]
    Option {
        /// Which.
        option: &'static str,
        /// Its value.
        found: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// Too little data.
    #[error(
        "{found} measured geometries within {largest_deg}° and more than {mirror_deg}° from the mirror direction: expected at least {expected}; measure more of them or use fewer harmonics"
    )]
    Data {
        /// Samples that take part.
        found: usize,
        /// The least number.
        expected: usize,
        /// Limit of the polar angles, degrees.
        largest_deg: f64,
        /// Cone left out, degrees.
        mirror_deg: f64,
    },
    /// The equations have no solution in f64.
    #[error("the equations of the map cannot be solved with smoothness {smoothness}: raise it")]
    Singular {
        /// λ.
        smoothness: f64,
    },
}

impl FlakeFitOptions {
    fn check(&self) -> Result<(), FitError> {
        let fail = |option, found: String, expected| Err(FitError::Option { option, found, expected });
        // not written as < so that NaN is refused
        if !(1.0..=4.0).contains(&self.index) {
            return fail("index", self.index.to_string(), "1 to 4");
        }
        if self.harmonics > MAX_HARMONICS {
            return fail("harmonics", self.harmonics.to_string(), "0 to 3");
        }
        if !self.nodes.iter().all(|n| (4..=256).contains(n)) {
            return fail("nodes", format!("{:?}", self.nodes), "4 to 256 each");
        }
        if !(1e-9..=1e6).contains(&self.smoothness) {
            return fail("smoothness", self.smoothness.to_string(), "1e-9 to 1e6");
        }
        if !(1e-4..=10.0).contains(&self.own_error) {
            return fail("own_error", self.own_error.to_string(), "1e-4 to 10");
        }
        Ok(())
    }
}

impl FlakeMap {
    /// Fits a map to samples.
    ///
    /// # Errors
    /// [`FitError`]: an option outside its bounds, too few samples, or no solution.
    pub fn fit(name: &str, samples: &[Sample], options: &FlakeFitOptions) -> Result<Self, FitError> {
        options.check()?;
        let taking: Vec<&Sample> =
            samples.iter().filter(|s| options.region.contains(s.light, s.view)).collect();
        let terms = options.harmonics + 1;
        if taking.len() < 3 * terms {
            return Err(FitError::Data {
                found: taking.len(),
                expected: 3 * terms,
                largest_deg: options.region.largest.degrees(),
                mirror_deg: options.region.from_mirror.degrees(),
            });
        }
        let [across, along] = options.nodes;
        let count = across * along;
        let rows: Vec<Row> = taking.iter().map(|s| Row::new(s, options)).collect();
        let total: f64 = rows.iter().map(|r| r.weight).sum();
        let unit = count as f64 / total;
        // means are taken off, so that the hold on the overall level below pulls towards them and not to zero
        let mean = [0, 1, 2].map(|c| rows.iter().map(|r| r.weight * r.y[c]).sum::<f64>() / total);

        let mut matrix = Banded::new(count * terms, 2 * along * terms);
        let mut right = vec![vec![0.0; count * terms]; 3];
        let mut covered = vec![false; count];
        for row in &rows {
            let w = row.weight * unit;
            let mut unknowns = [(0, 0.0); 4 * (MAX_HARMONICS + 1)];
            let used = &mut unknowns[..4 * terms];
            for (slot, u) in used.iter_mut().enumerate() {
                let (corner, k) = (slot / terms, slot % terms);
                *u = (row.corner[corner] * terms + k, row.share[corner] * row.basis[k]);
            }
            for (a, &(m, p)) in used.iter().enumerate() {
                for (r, (y, mean)) in right.iter_mut().zip(row.y.iter().zip(mean)) {
                    r[m] += w * p * (y - mean);
                }
                for &(n, q) in &used[..=a] {
                    matrix.add(m, n, w * p * q);
                }
            }
            for (node, share) in row.corner.iter().zip(row.share) {
                covered[*node] |= share > 0.0;
            }
        }
        smooth(&mut matrix, options);
        if !matrix.solve(&mut right) {
            return Err(FitError::Singular { smoothness: options.smoothness });
        }

        let coefficients = (0..count * terms)
            .map(|i| {
                let level = |c: usize| if i % terms == 0 { mean[c] } else { 0.0 };
                [0, 1, 2, 3].map(|c| right.get(c).map_or(0.0, |r| (r[i] + level(c)) as f32))
            })
            .collect();
        let extreme = |start: f64, pick: fn(f64, f64) -> f64| {
            let of = |c: usize| rows.iter().map(|r| r.y[c]).fold(start, pick) as f32;
            [of(0), of(1), of(2), 0.0]
        };
        Ok(Self {
            name: name.to_owned(),
            index: options.index,
            harmonics: options.harmonics,
            nodes: options.nodes,
            transform: options.transform,
            transmittance: options.transmittance,
            region: options.region,
            bounds: [extreme(f64::INFINITY, f64::min), extreme(f64::NEG_INFINITY, f64::max)],
            coefficients,
            covered,
        })
    }
}

/// One sample's equation.
struct Row {
    corner: [usize; 4],
    share: [f64; 4],
    basis: [f64; MAX_HARMONICS + 1],
    y: [f64; 3],
    weight: f64,
}

impl Row {
    fn new(s: &Sample, o: &FlakeFitOptions) -> Self {
        let p = FlakePoint::new(single(s.light), single(s.view), (1.0 / o.index) as f32);
        let (corner, share) = place(&p, o.index, o.nodes);
        let t = if o.transmittance {
            f64::from(transmittance(s.light.z as f32, s.view.z as f32, o.index as f32))
        } else {
            1.0
        };
        let f = s.value.map(|f| f / t);
        // of the three channels the mean: one weight keeps one matrix for all of them
        let variance: f64 =
            (0..3).map(|c| (s.sigma[c] / s.value[c].abs().max(DARKEST)).powi(2)).sum::<f64>() / 3.0;
        Self {
            corner,
            share: share.map(f64::from),
            basis: basis::<{ MAX_HARMONICS + 1 }>(&p, o.index).map(f64::from),
            y: f.map(|f| o.transform.forward(f)),
            weight: s.weight / (variance + o.own_error * o.own_error),
        }
    }
}

/// λ times the squares of second differences along both axes, and a faint hold on each unknown where nothing else decides.
fn smooth(matrix: &mut Banded, o: &FlakeFitOptions) {
    let ([across, along], terms) = (o.nodes, o.harmonics + 1);
    let at = |i: usize, j: usize, k: usize| (i * along + j) * terms + k;
    let mut bend = |u: [usize; 3]| {
        for (a, &m) in u.iter().enumerate() {
            for (b, &n) in u.iter().enumerate().take(a + 1) {
                let c = [1.0, -2.0, 1.0];
                matrix.add(m, n, o.smoothness * c[a] * c[b]);
            }
        }
    };
    for i in 0..across {
        for j in 0..along {
            for k in 0..terms {
                if i + 2 < across {
                    bend([at(i, j, k), at(i + 1, j, k), at(i + 2, j, k)]);
                }
                if j + 2 < along {
                    bend([at(i, j, k), at(i, j + 1, k), at(i, j + 2, k)]);
                }
            }
        }
    }
    for m in 0..across * along * terms {
        // harmonics are held a little more: where the azimuth was not varied they stay at zero
        let hold = if m % terms == 0 { 1e-6 } else { 1e-3 };
        matrix.add(m, m, hold * o.smoothness.min(1.0));
    }
}
