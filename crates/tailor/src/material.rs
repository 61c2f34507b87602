//! What is looked up: a measured table, scattered measurements, a function, a model or a flake map, with the samples it gives to fit and to judge.

use gonio_brdf::formats::Loaded;
use gonio_brdf::maps::{FlakeMap, Region, Sample};
use gonio_brdf::{Brdf, Flag, Grid, Meaning, Measured, Scattered};
use gonio_fitter::Observations;
use gonio_optics::{Angle, Geometry};

/// Samples drawn from a function to fit maps to.
const FITTED: usize = 30_000;
/// Samples drawn from a function to judge by.
const JUDGED: usize = 10_000;
/// Parts into which scattered measurements are split for judging.
const FOLDS: usize = 5;

/// A material with its name.
#[derive(Debug)]
pub struct Material {
    /// What it is called.
    pub name: String,
    loaded: Loaded,
}

/// What representations are judged by.
pub struct Judged<'a> {
    /// Geometries and colours, and the material to build from for them (`None`: the whole).
    pub parts: Vec<(Option<Material>, Vec<Sample>)>,
    /// In words: which geometries, and whether they were fitted too.
    pub how: &'a str,
}

impl Material {
    /// Of a file's content.
    #[must_use]
    pub fn new(name: impl Into<String>, loaded: Loaded) -> Self {
        Self { name: name.into(), loaded }
    }

    /// f everywhere; `None` for scattered measurements.
    #[must_use]
    pub fn brdf(&self) -> Option<&dyn Brdf> {
        self.loaded.as_brdf()
    }

    /// The measured table, if it is one.
    #[must_use]
    pub fn table(&self) -> Option<&Measured> {
        if let Loaded::Table(t) = &self.loaded { Some(t) } else { None }
    }

    /// The scattered measurements, if it is such.
    #[must_use]
    pub fn scattered(&self) -> Option<&Scattered> {
        if let Loaded::Scattered(s) = &self.loaded { Some(s) } else { None }
    }

    /// The flake map, if it is one.
    #[must_use]
    pub fn flake_map(&self) -> Option<&FlakeMap> {
        if let Loaded::Function(f) = &self.loaded { f.flake_map.as_deref() } else { None }
    }

    /// Whether it is a model with parameters.
    #[must_use]
    pub const fn is_model(&self) -> bool {
        matches!(self.loaded, Loaded::Model(_))
    }

    /// Refractive index of the coat as the file states it: of a model its coat's (1 without one), of a flake map its own, of a table the
    /// attribute `coat_index`. `None` where nothing is said.
    #[must_use]
    pub fn stated_index(&self) -> Option<f64> {
        match &self.loaded {
            Loaded::Model(m) => Some(m.coat.map_or(1.0, |c| c.index)),
            Loaded::Function(f) => f.flake_map.as_ref().map(|m| m.index()),
            Loaded::Table(t) => t
                .attributes
                .get("coat_index")
                .and_then(|s| s.parse().ok())
                .filter(|n| (1.0..=4.0).contains(n)),
            Loaded::Scattered(_) => None,
        }
    }

    /// Angular radius of the lamp that a table of cell means was measured with.
    #[must_use]
    pub fn lamp_half_angle(&self) -> Option<Angle> {
        match self.table()?.meaning {
            Meaning::CellMean { lamp_half_angle } if lamp_half_angle > Angle::ZERO => Some(lamp_half_angle),
            _ => None,
        }
    }

    /// What maps are fitted to: measured cells or points, or 30,000 values of a function, in `region`.
    #[must_use]
    pub fn samples(&self, region: Region) -> Vec<Sample> {
        match &self.loaded {
            Loaded::Table(t) => region.of_table(t),
            Loaded::Scattered(s) => region.of_scattered(s),
            Loaded::Function(_) | Loaded::Model(_) => {
                self.brdf().map_or_else(Vec::new, |f| region.of_brdf(f, FITTED, 0))
            }
        }
    }

    /// What models are fitted to.
    #[must_use]
    pub fn observations(&self) -> Option<Observations> {
        match &self.loaded {
            Loaded::Table(t) => Some(Observations::from_measured(t)),
            Loaded::Scattered(s) => Some(Observations::from_scattered(s)),
            Loaded::Function(_) | Loaded::Model(_) => {
                self.loaded.to_measured(&Grid::sopp()).as_ref().map(Observations::from_measured)
            }
        }
    }

    /// All geometries to `largest` by solid angle. A function is judged at others than it is fitted to; a table at its measured cells; scattered
    /// measurements in five parts, each by what was built from the other four.
    #[must_use]
    pub fn judged(&self, largest: Angle) -> Judged<'static> {
        // below zero, so that the mirror direction itself takes part
        let all = Region { largest, from_mirror: Angle::from_degrees(-1.0) };
        match &self.loaded {
            Loaded::Table(t) => Judged {
                parts: vec![(None, all.of_table(t))],
                how: "the measured cells, by solid angle; maps and models were fitted to the same cells",
            },
            Loaded::Scattered(s) => Judged {
                parts: (0..FOLDS).map(|k| self.fold(s, k, all)).collect(),
                how: "each fifth of the measurements, by what was built from the other four fifths",
            },
            Loaded::Function(_) | Loaded::Model(_) => Judged {
                parts: vec![(None, self.brdf().map_or_else(Vec::new, |f| all.of_brdf(f, JUDGED, 1)))],
                how: "10,000 geometries evenly by solid angle, others than those that were fitted",
            },
        }
    }

    fn fold(&self, s: &Scattered, k: usize, all: Region) -> (Option<Self>, Vec<Sample>) {
        let part = |inside: bool| Scattered {
            points: s
                .points
                .iter()
                .enumerate()
                .filter(|(i, _)| (place(*i, s.points.len()) % FOLDS == k) == inside)
                .map(|(_, p)| *p)
                .collect(),
        };
        let rest = Self::new(self.name.clone(), Loaded::Scattered(part(false)));
        (Some(rest), all.of_scattered(&part(true)))
    }

    /// Samples at geometries of the user's choice, with their weights, and how many of them have no measurement near: of a table those whose
    /// nearest cell was not measured. `None` for scattered measurements, which say nothing in between.
    #[must_use]
    pub fn samples_at(&self, geometries: &[(Geometry, f64)]) -> Option<(Vec<Sample>, usize)> {
        let brdf = self.brdf()?;
        let mut out = Vec::with_capacity(geometries.len());
        for &(g, weight) in geometries.iter().filter(|g| g.1 > 0.0) {
            let (light, view) = g.directions();
            if self.is_measured_near(g) {
                out.push(Sample { light, view, value: brdf.eval(light, view), sigma: [0.0; 3], weight });
            }
        }
        let asked = geometries.iter().filter(|g| g.1 > 0.0).count();
        let missing = asked - out.len();
        Some((out, missing))
    }

    /// Whether something was measured near a geometry: the nearest cell of a table, half a step beyond its nodes at most; a place of a flake map
    /// that data stood around. Functions and models have a value everywhere; of scattered points one within 5° of light and view counts.
    #[must_use]
    pub fn is_measured_near(&self, g: Geometry) -> bool {
        let (l, v) = g.directions();
        match &self.loaded {
            Loaded::Table(t) => measured_near(t, g),
            Loaded::Scattered(s) => s.points.iter().any(|p| {
                let (pl, pv) = p.geometry.directions();
                let near = |a: gonio_optics::Vec3, b: gonio_optics::Vec3| a.angle_to(b).degrees() <= 5.0;
                p.flag == Flag::Measured && near(l, pl) && near(v, pv)
            }),
            Loaded::Function(f) => f.flake_map.as_ref().is_none_or(|m| m.covers(l, v)),
            Loaded::Model(_) => true,
        }
    }
}

/// An order that mixes what stands side by side: steps of the golden ratio.
pub(crate) fn place(i: usize, n: usize) -> usize {
    if n == 0 { 0 } else { ((i as f64 * 0.618_033_988_749_894_9).fract() * n as f64) as usize }
}

fn measured_near(t: &Measured, g: Geometry) -> bool {
    let nearest = |nodes: &[f64], x: f64| {
        let (k, d) =
            nodes.iter().enumerate().map(|(k, n)| (k, (n - x).abs())).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let (low, high) = (nodes.get(k.saturating_sub(1))?, nodes.get((k + 1).min(nodes.len() - 1))?);
        // a single node stands for itself
        let reach = 0.5 * (nodes[k] - low).max(high - nodes[k]).max(1.0);
        (d <= reach + 1e-9).then_some(k)
    };
    let grid = &t.grid;
    let cell = nearest(&grid.theta_i_deg, g.theta_i.degrees())
        .zip(nearest(&grid.theta_o_deg, g.theta_o.degrees()))
        .zip(nearest(&grid.phi_deg, g.phi.folded().degrees()));
    cell.is_some_and(|((ti, to), phi)| t.flag.get(grid.index(ti, to, phi)) == Some(&Flag::Measured))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::{ScatteredPoint, models::Lambert};

    fn points(n: usize) -> Scattered {
        let at = |i: usize| ScatteredPoint {
            geometry: Geometry::from_degrees(
                10.0 + (i % 7) as f64 * 10.0,
                (i % 5) as f64 * 15.0,
                (i % 4) as f64 * 60.0,
            ),
            value: [0.1; 3],
            sigma: None,
            flag: Flag::Measured,
        };
        Scattered { points: (0..n).map(at).collect() }
    }

    #[test]
    fn folds_hold_every_point_once_and_build_from_the_others() {
        let m = Material::new("m", Loaded::Scattered(points(97)));
        let judged = m.judged(Angle::from_degrees(90.0));
        let counts: Vec<usize> = judged.parts.iter().map(|p| p.1.len()).collect();
        assert_eq!(counts.iter().sum::<usize>(), 97);
        assert!(counts.iter().all(|&c| (12..=26).contains(&c)), "{counts:?}");
        for (rest, part) in &judged.parts {
            let rest = rest.as_ref().and_then(Material::scattered).unwrap();
            assert_eq!(rest.points.len() + part.len(), 97);
        }
    }

    #[test]
    fn a_table_is_measured_where_its_cells_are() {
        let mut t = Measured::sampled(Grid::sopp(), &Lambert { diffuse: [0.5; 3] });
        let i = t.grid.index(9, 8, 0);
        t.flag[i] = Flag::Extrapolated;
        let m = Material::new("m", Loaded::Table(Box::new(t)));
        assert!(m.is_measured_near(Geometry::from_degrees(45.0, 23.0, 1.0)));
        assert!(!m.is_measured_near(Geometry::from_degrees(46.0, 20.4, 2.0)));
        let asked =
            [(Geometry::from_degrees(45.0, 20.0, 0.0), 1.0), (Geometry::from_degrees(45.0, 40.0, 0.0), 2.0)];
        let (samples, missing) = m.samples_at(&asked).unwrap();
        assert!(samples.len() == 1 && missing == 1 && samples[0].weight == 2.0);
    }
}
