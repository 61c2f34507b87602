//! Measurements in the shape the fit needs: rows of data that share an angle of incidence, each datum with what it stands for.

use std::sync::Arc;

use gonio_brdf::{Flag, Grid, Meaning, Measured, Scattered, ScatteredPoint, average::is_cap};
use gonio_optics::{Geometry, Vec3};

use crate::voronoi;

/// Measurements to be fitted.
#[derive(Clone, Debug)]
pub struct Observations {
    pub(crate) data: Vec<Datum>,
    pub(crate) source: Source,
    /// Places in the original table or list.
    pub(crate) places: usize,
    /// Whether the azimuths of light and view are known, not their difference alone.
    pub(crate) full_azimuths: bool,
    /// Relative standard uncertainty common to all values.
    pub(crate) common_relative_uncertainty: f64,
}

/// One cell or point that has a value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Datum {
    /// Row of the lobe's nodes (angle of incidence), 0 for points.
    pub row: u32,
    /// Place in that row.
    pub cell: u32,
    /// Place in the original table.
    pub place: u32,
    pub geometry: Geometry,
    pub value: [f64; 3],
    pub sigma: Option<[f64; 3]>,
    pub solid_angle: f64,
    pub flag: Flag,
}

/// How a model is compared with the data.
#[derive(Clone, Debug)]
pub(crate) enum Source {
    /// Cells or nodes of a grid.
    Grid(Grid, Meaning),
    /// Values at pairs of directions (light, view).
    Points(Arc<Vec<(Vec3, Vec3)>>),
}

impl Observations {
    /// The valid cells of a measured grid, cell means or node values as the table says.
    ///
    /// The row θo = 0 of a table of cell means is one cap and enters once, under the first valid φ; so does a row of nodes that
    /// repeats one value. `common_relative_uncertainty` is read from the attribute of that name.
    #[must_use]
    pub fn from_measured(m: &Measured) -> Self {
        let [ni, no, np] = m.grid.shape();
        let mut data = Vec::new();
        for ti in 0..ni {
            for to in 0..no {
                let row_of_one = is_cap(&m.grid, to) && repeats(m, ti, to, np);
                let ring: f64 = (0..np).map(|p| m.grid.solid_angle(to, p)).sum();
                for phi in 0..np {
                    let place = m.grid.index(ti, to, phi);
                    let (Some(&value), Some(&flag)) = (m.values.get(place), m.flag.get(place)) else {
                        continue;
                    };
                    let value = value.map(f64::from);
                    if flag == Flag::Invalid || value.iter().any(|v| !v.is_finite()) {
                        continue;
                    }
                    let sigma = m.sigma.get(place).map(|s| s.map(f64::from));
                    data.push(Datum {
                        row: ti as u32,
                        cell: (to * np + phi) as u32,
                        place: place as u32,
                        geometry: m.grid.geometry(ti, to, phi),
                        value,
                        sigma: sigma.filter(usable),
                        solid_angle: if row_of_one { ring } else { m.grid.solid_angle(to, phi) },
                        flag,
                    });
                    if row_of_one {
                        break;
                    }
                }
            }
        }
        let common = m.attributes.get("common_relative_uncertainty").and_then(|s| s.trim().parse().ok());
        Self {
            data,
            source: Source::Grid(m.grid.clone(), m.meaning),
            places: m.grid.len(),
            full_azimuths: false,
            common_relative_uncertainty: common.filter(|u: &f64| u.is_finite() && *u >= 0.0).unwrap_or(0.0),
        }
    }

    /// Scattered points, node values. Their solid angles are Voronoi areas among the points of the same angle of incidence (to 0.5°), found
    /// by counting which point is nearest to each of 2048 evenly spread views; a set with fewer than 8 points shares the hemisphere evenly.
    #[must_use]
    pub fn from_scattered(s: &Scattered) -> Self {
        let mut data: Vec<Datum> = Vec::new();
        let mut directions = Vec::new();
        for (place, p) in s.points.iter().enumerate() {
            let angles = [p.geometry.theta_i, p.geometry.theta_o, p.geometry.phi];
            let finite =
                angles.iter().all(|a| a.radians().is_finite()) && p.value.iter().all(|v| v.is_finite());
            if p.flag == Flag::Invalid || !finite {
                continue;
            }
            data.push(Datum {
                row: 0,
                cell: data.len() as u32,
                place: place as u32,
                geometry: p.geometry,
                value: p.value,
                sigma: p.sigma.filter(usable),
                solid_angle: 0.0,
                flag: p.flag,
            });
            directions.push(p.geometry.directions());
        }
        let geometries: Vec<Geometry> = data.iter().map(|d| d.geometry).collect();
        for (d, area) in data.iter_mut().zip(voronoi::solid_angles(&geometries)) {
            d.solid_angle = area;
        }
        Self {
            data,
            source: Source::Points(Arc::new(directions)),
            places: s.points.len(),
            full_azimuths: false,
            common_relative_uncertainty: 0.0,
        }
    }

    /// Node values at pairs of unit directions (light, view) with azimuths of their own, as an anisotropic sample needs them.
    ///
    /// Files hold azimuth differences alone, so this is the way in for such data. Solid angles are those of [`Observations::from_scattered`], among the
    /// points of one angle of incidence whatever its azimuth.
    #[must_use]
    pub fn from_directions(points: &[(Vec3, Vec3, [f64; 3])]) -> Self {
        let scattered = Scattered {
            points: points
                .iter()
                .map(|&(l, v, value)| ScatteredPoint {
                    geometry: Geometry::from_directions(l, v),
                    value,
                    sigma: None,
                    flag: if usable_direction(l) && usable_direction(v) {
                        Flag::Measured
                    } else {
                        Flag::Invalid
                    },
                })
                .collect(),
        };
        let mut out = Self::from_scattered(&scattered);
        let own = out.data.iter().filter_map(|d| points.get(d.place as usize).map(|p| (p.0, p.1))).collect();
        out.source = Source::Points(Arc::new(own));
        out.full_azimuths = true;
        out
    }

    /// Values of a grid in double precision (a [`Measured`] keeps them in single): one per place of [`Grid::index`], all measured, σ unknown.
    #[must_use]
    pub fn from_grid_values(grid: &Grid, meaning: Meaning, values: &[[f64; 3]]) -> Self {
        let mut table = Measured::empty(grid.clone(), meaning);
        for (i, v) in values.iter().enumerate().take(table.values.len()) {
            table.values[i] = v.map(|x| x as f32);
            table.flag[i] = Flag::Measured;
        }
        let mut out = Self::from_measured(&table);
        for d in &mut out.data {
            if let Some(v) = values.get(d.place as usize) {
                d.value = *v;
            }
        }
        out
    }

    /// Whether a value is a mean over a bin and a lamp.
    pub(crate) fn averages(&self) -> bool {
        matches!(self.source, Source::Grid(_, Meaning::CellMean { .. }))
    }

    /// Number of valid measurements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.data.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.data.is_empty()
    }
}

/// A direction above the horizon, of length 1.
fn usable_direction(d: Vec3) -> bool {
    d.z >= 0.0 && (d.norm() - 1.0).abs() < 1e-6
}

/// A σ that can weigh: finite and above 0 in every channel.
fn usable(s: &[f64; 3]) -> bool {
    s.iter().all(|v| v.is_finite() && *v > 0.0)
}

/// Whether the valid values of the cap repeat one number for all φ.
fn repeats(m: &Measured, ti: usize, to: usize, np: usize) -> bool {
    if matches!(m.meaning, Meaning::CellMean { .. }) {
        return true;
    }
    let mut valid = (0..np)
        .map(|p| m.grid.index(ti, to, p))
        .filter(|&i| m.flag.get(i).is_some_and(|&f| f != Flag::Invalid))
        .filter_map(|i| m.values.get(i));
    let first = valid.next();
    valid.all(|v| Some(v) == first)
}
