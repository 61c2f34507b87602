//! What is fitted: a measured table or scattered points, and what is taken off them before.

use gonio_brdf::average::{CellBounds, gloss_cell_mean};
use gonio_brdf::{Coat, Flag, Meaning, Measured, Rgb, Scattered};
use gonio_fitter::{Fit, Observations};
use gonio_optics::Geometry;

use super::colour::Row;
use crate::car_paint::{CarPaint, CarPaintError, CarPaintParts, Flakes};

/// Share of a measured value that is left to the base at least.
const LEFT: f64 = 0.02;

/// A measurement.
#[derive(Clone, Copy, Debug)]
pub enum Subject<'a> {
    /// On a grid.
    Table(&'a Measured),
    /// Anywhere.
    Scattered(&'a Scattered),
}

/// A measurement that may be changed.
#[derive(Clone, Debug)]
pub(super) enum Data {
    Table(Box<Measured>),
    Scattered(Scattered),
}

impl Subject<'_> {
    pub(super) fn to_owned_data(self) -> Data {
        match self {
            Self::Table(t) => Data::Table(Box::new(t.clone())),
            Self::Scattered(s) => Data::Scattered(s.clone()),
        }
    }
}

impl Data {
    pub(super) fn observations(&self) -> Observations {
        match self {
            Self::Table(t) => Observations::from_measured(t),
            Self::Scattered(s) => Observations::from_scattered(s),
        }
    }

    /// Changes every valid value; `change` is told the place, the geometry and the value.
    fn each(&mut self, mut change: impl FnMut(usize, Geometry, Rgb) -> Rgb) {
        match self {
            Self::Table(t) => {
                for place in 0..t.values.len().min(t.flag.len()) {
                    if t.flag[place] != Flag::Invalid {
                        let [ti, to, phi] = t.grid.coordinates(place);
                        let g = t.grid.geometry(ti, to, phi);
                        t.values[place] = change(place, g, t.values[place].map(f64::from)).map(|v| v as f32);
                    }
                }
            }
            Self::Scattered(s) => {
                for (place, p) in s.points.iter_mut().enumerate() {
                    if p.flag != Flag::Invalid {
                        p.value = change(place, p.geometry, p.value);
                    }
                }
            }
        }
    }

    /// Takes off what flakes add on average under a coat. At least [`LEFT`] of a value stays: lobes are fitted to logarithms, and a cell that is all flakes, give or
    /// take its noise, would be lost where it says that the base is dark.
    pub(super) fn subtract(&mut self, flakes: &Flakes, coat: Option<Coat>) -> Result<(), CarPaintError> {
        let only_coat = CarPaint::new(CarPaintParts { coat, ..CarPaintParts::default() })?;
        self.each(|_, g, value| {
            let (l, v) = g.directions();
            let Some(at) = only_coat.inside(l, v) else { return value };
            let mean = flakes.mean(at.place);
            [0, 1, 2].map(|c| (value[c] - at.factor * mean[c]).max(LEFT * value[c].max(0.0)))
        });
        Ok(())
    }

    /// Takes off the gloss of a coat, which cell means contain.
    pub(super) fn subtract_gloss(&mut self, coat: Coat) {
        let levels = self.gloss(coat);
        self.each(|place, _, value| value.map(|v| v - levels.get(place).copied().unwrap_or(0.0)));
    }

    /// Gloss of a coat at each place; empty for values at nodes, where a delta has none.
    fn gloss(&self, coat: Coat) -> Vec<f64> {
        let Self::Table(t) = self else { return Vec::new() };
        let Meaning::CellMean { lamp_half_angle } = t.meaning else { return Vec::new() };
        (0..t.grid.len())
            .map(|place| {
                let b = CellBounds::of(&t.grid, lamp_half_angle, t.grid.coordinates(place));
                gloss_cell_mean(coat.gloss_level(b.theta_i.cos(), lamp_half_angle), &b)
            })
            .collect()
    }

    /// The mean of the channels in every channel; its σ likewise.
    pub(super) fn grey(&self) -> Self {
        let mut out = self.clone();
        out.each(|_, _, value| [mean(value); 3]);
        let root = |s: Rgb| [s.iter().map(|s| s * s).sum::<f64>().sqrt() / 3.0; 3];
        match &mut out {
            Self::Table(t) => {
                t.sigma.iter_mut().for_each(|s| *s = root(s.map(f64::from)).map(|v| v as f32));
            }
            Self::Scattered(s) => s.points.iter_mut().for_each(|p| p.sigma = p.sigma.map(root)),
        }
        out
    }

    /// The value at a place.
    pub(super) fn at(&self, place: usize) -> Rgb {
        match self {
            Self::Table(t) => t.values.get(place).map_or([0.0; 3], |v| v.map(f64::from)),
            Self::Scattered(s) => s.points.get(place).map_or([0.0; 3], |p| p.value),
        }
    }

    /// Each valid place with its geometry and value.
    pub(super) fn valid(&self) -> Vec<(usize, Geometry, Rgb)> {
        match self {
            Self::Table(t) => (0..t.values.len().min(t.flag.len()))
                .filter(|&place| t.flag[place] != Flag::Invalid)
                .map(|place| {
                    let [ti, to, phi] = t.grid.coordinates(place);
                    (place, t.grid.geometry(ti, to, phi), t.values[place].map(f64::from))
                })
                .collect(),
            Self::Scattered(s) => {
                let valid = s.points.iter().enumerate().filter(|(_, p)| p.flag != Flag::Invalid);
                valid.map(|(place, p)| (place, p.geometry, p.value)).collect()
            }
        }
    }

    /// Solid angle of a cell, or 1.
    pub(super) fn weight(&self, place: usize) -> f64 {
        match self {
            Self::Table(t) => {
                let [_, to, phi] = t.grid.coordinates(place);
                t.grid.solid_angle(to, phi)
            }
            Self::Scattered(_) => 1.0,
        }
    }

    /// Each cell that took part in the fit of the lobes to the mean of the channels: its value, and what the base gives there, the gloss taken off both.
    /// `whole` is the measurement with its flakes.
    pub(super) fn rows(&self, fit: &Fit, whole: &Self) -> Vec<Row> {
        let gloss = fit.coat.map(|c| self.gloss(c)).unwrap_or_default();
        let mut rows = Vec::new();
        for (place, geometry, value) in self.valid() {
            let gloss = gloss.get(place).copied().unwrap_or(0.0);
            // measured less the residual is the model's mean over the cell, coat and gloss included
            let residual = fit.residuals.get(place).map_or(f64::NAN, |r| f64::from(r[0]));
            let base = mean(value) - residual - gloss;
            let weight = self.weight(place);
            if base.is_finite() && base > 0.0 {
                // the gloss counts as seen: where it outshines the base, what is left of the measurement is its error
                let seen = mean(whole.at(place));
                rows.push(Row { geometry, value: value.map(|v| v - gloss), base, seen, weight });
            }
        }
        rows
    }
}

fn mean(v: Rgb) -> f64 {
    v.iter().sum::<f64>() / 3.0
}
