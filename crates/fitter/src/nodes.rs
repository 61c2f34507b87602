//! Where a model is evaluated: one pair of directions for a node or point, the quadrature of its bin and lamp for a cell.

use gonio_brdf::{
    Meaning,
    average::{CellBounds, cell_nodes, gloss_cell_mean},
};
use rayon::prelude::*;

use crate::{
    Observations,
    observations::Source,
    ray::{Ray, Sample},
    rows::Rows,
};

/// The pairs of directions of many rows, one row after the other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Nodes {
    start: Vec<u32>,
    samples: Vec<Sample>,
    /// The samples as the base sees them, where the coat's index is known.
    rays: Vec<Ray<f64>>,
    /// Share of a cell that the mirror image of the lamp covers, times 1/sr: what the gloss of a coat is multiplied by. Empty where nothing glosses.
    pub gloss: Vec<(f64, f64)>,
    /// Lobes up to this sharpness are averaged right.
    pub sharpness: f64,
}

impl Nodes {
    /// For lobes up to `sharpness`, seen through a coat of a known index, if any.
    pub(crate) fn new(
        obs: &Observations,
        rows: &Rows,
        sharpness: f64,
        index: Option<f64>,
        with_gloss: bool,
    ) -> Self {
        const PIECE: usize = 256;
        let parts: Vec<(Vec<Sample>, Vec<u32>)> = rows
            .rows
            .par_chunks(PIECE)
            .map(|piece| {
                let (mut samples, mut counts) = (Vec::new(), Vec::with_capacity(piece.len()));
                for row in piece {
                    let before = samples.len();
                    let d = &row.datum;
                    match &obs.source {
                        Source::Grid(grid, Meaning::CellMean { lamp_half_angle }) => {
                            let cell = grid.coordinates(d.place as usize);
                            let bounds = CellBounds::of(grid, *lamp_half_angle, cell);
                            cell_nodes(&bounds, sharpness, &mut |w, l, v| {
                                samples.extend(Sample::new(w, l, v));
                            });
                        }
                        Source::Grid(_, Meaning::Node) => {
                            let (l, v) = d.geometry.directions();
                            samples.extend(Sample::new(1.0, l, v));
                        }
                        Source::Points(directions) => {
                            if let Some(&(l, v)) = directions.get(d.cell as usize) {
                                samples.extend(Sample::new(1.0, l, v));
                            }
                        }
                    }
                    counts.push((samples.len() - before) as u32);
                }
                (samples, counts)
            })
            .collect();
        let mut out = Self { start: vec![0], sharpness, ..Self::default() };
        for (samples, counts) in parts {
            out.samples.extend(samples);
            for n in counts {
                let last = out.start.last().copied().unwrap_or(0);
                out.start.push(last + n);
            }
        }
        out.rays = out.samples.iter().map(|s| s.ray(index)).collect();
        if with_gloss && let Source::Grid(grid, Meaning::CellMean { lamp_half_angle }) = &obs.source {
            out.gloss = rows
                .rows
                .iter()
                .map(|row| {
                    let b =
                        CellBounds::of(grid, *lamp_half_angle, grid.coordinates(row.datum.place as usize));
                    let s = lamp_half_angle.sin();
                    let cos = b.theta_i.cos();
                    let level = if s > 0.0 {
                        (std::f64::consts::PI * s * s * cos.max(gonio_optics::COS_FLOOR)).recip()
                    } else {
                        0.0
                    };
                    (gloss_cell_mean(level, &b), cos)
                })
                .collect();
            if out.gloss.iter().all(|g| g.0 == 0.0) {
                out.gloss.clear();
            }
        }
        out
    }

    fn range(&self, row: usize) -> std::ops::Range<usize> {
        match (self.start.get(row), self.start.get(row + 1)) {
            (Some(&a), Some(&b)) => a as usize..b as usize,
            _ => 0..0,
        }
    }

    /// Weights and rays of a row, for a known index (or none).
    pub(crate) fn rays(&self, row: usize) -> impl Iterator<Item = (f64, &Ray<f64>)> {
        let range = self.range(row);
        self.samples[range.clone()].iter().zip(&self.rays[range]).map(|(s, r)| (s.weight, r))
    }

    /// The samples of a row.
    pub(crate) fn samples(&self, row: usize) -> &[Sample] {
        &self.samples[self.range(row)]
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.start.len() - 1
    }
}
