//! The data that take part in a fit, their weights, and the sums over them for a given exponent.

use std::sync::Arc;

use gonio_brdf::{
    Brdf, Flag, Rgb,
    average::{
        adaptive_cell_mean,
        lobe::{LobeNodes, LobeValue},
    },
    models::AshikhminShirley,
};
use gonio_optics::Vec3;
use rayon::prelude::*;

use crate::{
    Observations, Options, Weights,
    cache::{self, Lobes},
    linear::Sums,
    observations::{Datum, Source},
};

/// Data of one piece of work.
const CHUNK: usize = 2048;

/// Which diffuse term the model has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Diffuse {
    /// 1/π.
    Lambert,
    /// 28/(23π)(1 − (1 − n·l/2)^5)(1 − (1 − n·v/2)^5), the factor 1 − r0 left to the coefficient.
    AshikhminShirley,
}

/// An exponent of the coarse grid or any other.
#[derive(Clone, Copy, Debug)]
pub(crate) enum At {
    Knot(usize),
    Exponent(f64),
}

/// One datum in the fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    pub datum: Datum,
    /// Diffuse term, 1/sr.
    pub diffuse: f64,
    /// Weight of the square, per channel.
    pub weight: [f64; 3],
}

/// What is to be minimised.
pub(crate) struct Problem {
    /// Pieces of data that share a row.
    pub pieces: Vec<Vec<Item>>,
    lobes: LobeSource,
    /// Σ w over all data, the denominator of (3.5) and (4.25).
    pub solid_angle: f64,
}

enum LobeSource {
    Grid(Arc<Lobes>),
    Points(Arc<LobeNodes>),
}

impl Problem {
    pub(crate) fn new(obs: &Observations, options: &Options, diffuse: Diffuse) -> Self {
        let limit = options.max_angle.degrees() + 1e-9;
        let chosen: Vec<&Datum> = obs
            .data
            .iter()
            .filter(|d| d.geometry.theta_i.degrees() <= limit && d.geometry.theta_o.degrees() <= limit)
            .filter(|d| d.flag == Flag::Measured || (options.include_filled && d.flag != Flag::Invalid))
            .filter(|d| options.weights != Weights::Sigma || d.sigma.is_some())
            .collect();
        let solid_angle: f64 = chosen.iter().map(|d| d.solid_angle).sum();
        let term = |d: &Datum| match diffuse {
            Diffuse::Lambert => std::f64::consts::FRAC_1_PI,
            Diffuse::AshikhminShirley => diffuse_mean(obs, d),
        };
        let items: Vec<Item> = chosen
            .par_iter()
            .map(|&&datum| Item {
                datum,
                diffuse: term(&datum),
                weight: weight(&datum, options.weights, solid_angle),
            })
            .collect();
        let mut pieces: Vec<Vec<Item>> = Vec::new();
        for item in items {
            match pieces.last_mut() {
                Some(p) if p.len() < CHUNK && p.first().is_some_and(|i| i.datum.row == item.datum.row) => {
                    p.push(item);
                }
                _ => pieces.push(vec![item]),
            }
        }
        let lobes = match &obs.source {
            Source::Grid(grid, meaning) => LobeSource::Grid(cache::lobes(grid, *meaning, options.max_angle)),
            Source::Points(nodes) => LobeSource::Points(Arc::clone(nodes)),
        };
        Self { pieces, lobes, solid_angle }
    }

    pub(crate) fn items(&self) -> impl Iterator<Item = &Item> {
        self.pieces.iter().flatten()
    }

    pub(crate) fn len(&self) -> usize {
        self.pieces.iter().map(Vec::len).sum()
    }

    /// Sums of the three channels at an exponent. Always added in the same order.
    pub(crate) fn sums(&self, at: At) -> [Sums; 3] {
        let parts: Vec<[Sums; 3]> = self
            .pieces
            .par_iter()
            .map(|piece| {
                let mut sums = [Sums::default(); 3];
                let mut add = |item: &Item, lobe: (f64, f64)| {
                    for (c, s) in sums.iter_mut().enumerate() {
                        s.add(item.weight[c], item.diffuse, lobe, item.datum.value[c]);
                    }
                };
                let row = piece.first().map_or(0, |i| i.datum.row as usize);
                match (&self.lobes, at) {
                    (LobeSource::Grid(lobes), At::Knot(k)) => {
                        let values = lobes.at_knot(k, row);
                        for item in piece {
                            add(item, values.get(item.datum.cell as usize).copied().unwrap_or_default());
                        }
                    }
                    (_, at) => {
                        let exponent = match at {
                            At::Knot(k) => cache::knot(k),
                            At::Exponent(n) => n,
                        };
                        let nodes = self.nodes(row, exponent);
                        for item in piece {
                            add(item, nodes.value(item.datum.cell as usize, exponent));
                        }
                    }
                }
                sums
            })
            .collect();
        let mut total = [Sums::default(); 3];
        for part in &parts {
            for c in 0..3 {
                total[c].merge(&part[c]);
            }
        }
        total
    }

    /// Lobe and its derivative at every datum, in the order of [`Problem::items`].
    pub(crate) fn lobe(&self, exponent: f64) -> Vec<LobeValue> {
        let parts: Vec<Vec<LobeValue>> = self
            .pieces
            .par_iter()
            .map(|piece| {
                let row = piece.first().map_or(0, |i| i.datum.row as usize);
                let nodes = self.nodes(row, exponent);
                piece.iter().map(|i| nodes.with_derivative(i.datum.cell as usize, exponent)).collect()
            })
            .collect();
        parts.concat()
    }

    fn nodes(&self, row: usize, exponent: f64) -> &LobeNodes {
        match &self.lobes {
            LobeSource::Grid(lobes) => lobes.cells.row(row, exponent),
            LobeSource::Points(nodes) => nodes,
        }
    }
}

/// Weight of the square of a residual, per channel.
fn weight(d: &Datum, weights: Weights, total: f64) -> [f64; 3] {
    let cos = d.geometry.theta_i.cos().max(0.0);
    // all areas 0 (a grid of one node): every cell alike
    let w = if total > 0.0 { d.solid_angle } else { 1.0 };
    match weights {
        Weights::Sopp => [(w * cos).powi(2); 3],
        Weights::Ngan => [w * cos * cos; 3],
        Weights::Sigma => d.sigma.map_or([0.0; 3], |s| s.map(|s| 1.0 / (s * s))),
        Weights::None => [1.0; 3],
    }
}

/// The diffuse term of the full model for cd = 1 and r0 = 0.
struct DiffuseTerm;

impl Brdf for DiffuseTerm {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        [AshikhminShirley::diffuse_term(0.0, light, view); 3]
    }
}

fn diffuse_mean(obs: &Observations, d: &Datum) -> f64 {
    match &obs.source {
        Source::Grid(grid, meaning) => {
            adaptive_cell_mean(&DiffuseTerm, grid, *meaning, grid.coordinates(d.place as usize))[0]
        }
        Source::Points(_) => {
            let (l, v) = d.geometry.directions();
            DiffuseTerm.eval(l, v)[0]
        }
    }
}
