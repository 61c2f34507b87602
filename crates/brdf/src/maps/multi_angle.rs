//! A flake map from the handful of geometries of a portable instrument, with an uncertainty.
//!
//! y = log2 f over flake space is taken as a Gaussian process: a level, a profile over θ_flake, and what θ_inc changes of it,
//!
//! ```text
//! y(u, w) ~ GP(−g u, k)      u = √(n sin θ_flake),   w = (n sin θ_inc)²
//! k = a₀² + a₁² M(Δu/ℓ₁) + a₂² M(Δu/ℓ₂) M(Δw/ℓ₃)      M(r) = (1 + √3 r) exp(−√3 r)
//! ```
//!
//! whose numbers ([`Prior::GENERAL`]) are those of materials in general. The measurements correct the mean where they are and near it; elsewhere the
//! variance stays. The scale of the variance follows the material: it is estimated together with the prior's own (an inverse gamma prior of weight ν), so
//! a plain paint gets a small uncertainty and an unusual one a large one. What f has beside a function of flake space is part of it (a_m).

use gonio_optics::Geometry;

use super::{
    FitError, FlakeMap, Region, Sample, Transform,
    banded::Banded,
    finding::Finding,
    flake_map::place,
    flake_point::{FlakePoint, single},
};

/// Most measurements that are taken: the equations are dense.
const MOST: usize = 1024;
/// Nodes of the map, each axis.
const NODES: usize = 40;
/// How far beyond the measured values an estimate may go, in octaves.
const BEYOND: f64 = 3.0;

/// What is usual among materials, in octaves of f.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// g, slope of the mean over u.
    pub slope: f64,
    /// a₀, of the level.
    pub level: f64,
    /// a₁, of the profile over θ_flake.
    pub profile: f64,
    /// ℓ₁, in u.
    pub profile_length: f64,
    /// a₂, of what θ_inc changes.
    pub change: f64,
    /// ℓ₂, in u.
    pub change_flake_length: f64,
    /// ℓ₃, in w.
    pub change_inc_length: f64,
    /// a_m, of what is no function of flake space; also that of each measurement.
    pub own: f64,
    /// ν, weight of the prior's scale against one value of one channel.
    pub weight: f64,
    /// What the deviation is multiplied with so that 95 % of values lie within two of them: materials are less alike than a Gaussian process has it.
    pub spread: f64,
}

/// The eight geometries of portable multi-angle instruments: light at 45° seen at −15°, 15°, 25°, 45°, 75°, 110° from the mirror direction
/// (towards the light), light at 15° seen at −15° and 15°.
#[must_use]
pub fn portable_geometries() -> [Geometry; 8] {
    [
        (45.0, -15.0),
        (45.0, 15.0),
        (45.0, 25.0),
        (45.0, 45.0),
        (45.0, 75.0),
        (45.0, 110.0),
        (15.0, -15.0),
        (15.0, 15.0),
    ]
    .map(|(light, aspecular): (f64, f64)| {
        let view = light - aspecular;
        Geometry::from_degrees(light, view.abs(), if view < 0.0 { 0.0 } else { 180.0 })
    })
}

/// A place as the process knows it.
#[derive(Clone, Copy, Debug)]
struct Place {
    u: f64,
    w: f64,
}

impl Prior {
    fn covariance(&self, a: Place, b: Place) -> f64 {
        let m = |r: f64| {
            let r = 3.0f64.sqrt() * r.abs();
            (1.0 + r) * (-r).exp()
        };
        let (du, dw) = (a.u - b.u, a.w - b.w);
        self.level * self.level
            + self.profile * self.profile * m(du / self.profile_length)
            + self.change * self.change * m(du / self.change_flake_length) * m(dw / self.change_inc_length)
    }
}

/// The process given measurements.
struct Posterior {
    prior: Prior,
    at: Vec<Place>,
    /// K⁻¹ (y − mean), per channel.
    pull: [Vec<f64>; 3],
    /// K, lower band of full width.
    matrix: Vec<f64>,
    /// Scale of the variance.
    scale: f64,
}

impl Posterior {
    fn new(prior: Prior, data: &[(Place, [f64; 3], f64)]) -> Option<Self> {
        let n = data.len();
        let at: Vec<Place> = data.iter().map(|d| d.0).collect();
        let mut matrix = vec![0.0; n * n];
        for r in 0..n {
            for c in 0..n {
                let noise = if r == c { prior.own * prior.own + data[r].2 } else { 0.0 };
                matrix[r * n + c] = prior.covariance(at[r], at[c]) + noise;
            }
        }
        let right: [Vec<f64>; 3] =
            std::array::from_fn(|c| data.iter().map(|d| d.1[c] + prior.slope * d.0.u).collect());
        let mut pull = right.clone();
        if !full(&matrix, n).solve(&mut pull) {
            return None;
        }
        let misfit: f64 =
            (0..3).map(|c| right[c].iter().zip(&pull[c]).map(|(r, p)| r * p).sum::<f64>()).sum();
        let scale = (prior.weight + misfit) / (prior.weight + 3.0 * n as f64);
        Some(Self { prior, at, pull, matrix, scale })
    }

    /// Means of y and their common variance at many places.
    fn at(&self, places: &[Place]) -> Option<Vec<([f64; 3], f64)>> {
        let n = self.at.len();
        let cross: Vec<Vec<f64>> =
            places.iter().map(|p| self.at.iter().map(|a| self.prior.covariance(*p, *a)).collect()).collect();
        let mut solved = cross.clone();
        if !full(&self.matrix, n).solve(&mut solved) {
            return None;
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let one = |(p, (k, s)): (&Place, (&Vec<f64>, &Vec<f64>))| {
            let mean = std::array::from_fn(|c| dot(k, &self.pull[c]) - self.prior.slope * p.u);
            let own = self.prior.own * self.prior.own;
            let variance = (self.prior.covariance(*p, *p) - dot(k, s)).max(0.0) + own;
            (mean, self.prior.spread * self.prior.spread * self.scale * variance)
        };
        Some(places.iter().zip(cross.iter().zip(&solved)).map(one).collect())
    }
}

fn full(matrix: &[f64], n: usize) -> Banded {
    let mut m = Banded::new(n, n.saturating_sub(1));
    for r in 0..n {
        for c in 0..=r {
            m.add(r, c, matrix[r * n + c]);
        }
    }
    m
}

fn place_of(s: &Sample, index: f64) -> Place {
    let p = FlakePoint::new(single(s.light), single(s.view), (1.0 / index) as f32);
    Place { u: index.sqrt() * f64::from(p.root_flake), w: (index * f64::from(p.sin_inc)).powi(2) }
}

impl FlakeMap {
    /// Estimates a map from few geometries, mostly in-plane, with its uncertainty ([`FlakeMap::sigma`]): K = 0, index of the coat `index`.
    ///
    /// # Errors
    /// [`FitError`]: fewer than 3 or more than 1,024 usable samples, an index out of its bounds, no solution.
    pub fn from_multi_angle(name: &str, samples: &[Sample], index: f64) -> Result<Self, FitError> {
        Self::from_multi_angle_with(name, samples, index, &Prior::GENERAL)
    }

    /// As [`Self::from_multi_angle`], with another idea of what is usual.
    ///
    /// # Errors
    /// As there.
    pub fn from_multi_angle_with(
        name: &str,
        samples: &[Sample],
        index: f64,
        prior: &Prior,
    ) -> Result<Self, FitError> {
        if !(1.0..=4.0).contains(&index) {
            return Err(FitError::Option { option: "index", found: index.to_string(), expected: "1 to 4" });
        }
        let region = Region::default();
        let transform = Transform::Log;
        let usable: Vec<&Sample> = samples
            .iter()
            .filter(|s| {
                s.light.z > 0.0 && s.view.z > 0.0 && s.value.iter().chain(&s.sigma).all(|x| x.is_finite())
            })
            .collect();
        if !(3..=MOST).contains(&usable.len()) {
            return Err(FitError::Option {
                option: "geometries",
                found: usable.len().to_string(),
                expected: "3 to 1024; a fit takes more",
            });
        }
        let data: Vec<(Place, [f64; 3], f64)> = usable
            .iter()
            .map(|s| {
                let y = s.value.map(|f| transform.forward(f));
                let noise =
                    (0..3).map(|c| (s.sigma[c] * transform.slope(s.value[c])).powi(2)).sum::<f64>() / 3.0;
                (place_of(s, index), y, noise)
            })
            .collect();
        let step = |k: usize| k as f64 / (NODES - 1) as f64;
        let nodes: Vec<Place> =
            (0..NODES * NODES).map(|i| Place { u: step(i % NODES), w: step(i / NODES).powi(2) }).collect();
        let estimate = Posterior::new(*prior, &data)
            .and_then(|p| p.at(&nodes))
            .ok_or(FitError::Singular { smoothness: prior.own })?;
        let mut covered = vec![false; NODES * NODES];
        for s in &usable {
            let p = FlakePoint::new(single(s.light), single(s.view), (1.0 / index) as f32);
            let (corner, share) = place(&p, index, [NODES; 2]);
            corner.iter().zip(share).filter(|(_, s)| *s > 0.0).for_each(|(c, _)| covered[*c] = true);
        }
        let extreme = |start: f64, pick: fn(f64, f64) -> f64, by: f64| {
            let of = |c: usize| (data.iter().map(|d| d.1[c]).fold(start, pick) + by) as f32;
            [of(0), of(1), of(2), 0.0]
        };
        Ok(Self {
            name: name.to_owned(),
            index,
            harmonics: 0,
            nodes: [NODES; 2],
            transform,
            edge: 0.0,
            region,
            bounds: [extreme(f64::INFINITY, f64::min, -BEYOND), extreme(f64::NEG_INFINITY, f64::max, BEYOND)],
            coefficients: estimate
                .iter()
                .map(|(y, _)| [y[0] as f32, y[1] as f32, y[2] as f32, 0.0])
                .collect(),
            covered,
            sigma: Some(estimate.iter().map(|(_, v)| v.sqrt() as f32).collect()),
            findings: vec![Finding::Estimated { measured: usable.len() }],
        })
    }
}

impl Prior {
    /// Learnt by `examples/learn_prior.rs`: the density of what 87 networks of MERL materials say (all but the 13 metallic and colour-changing paints),
    /// given their eight portable geometries.
    pub const GENERAL: Self = Self {
        slope: 3.374,
        level: 4.0,
        profile: 0.816,
        profile_length: 1.608,
        change: 0.198,
        change_flake_length: 0.384,
        change_inc_length: 0.794,
        own: 0.0123,
        weight: 15.2,
        spread: 1.69,
    };
}
