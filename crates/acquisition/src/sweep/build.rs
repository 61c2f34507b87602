//! Runs out of weights: once for all poses of a tilt.

use rayon::prelude::*;

use super::band::{Band, Run, Slot};
use super::{BAND, Known, LANES, Sweep, Window};
use crate::cells;
use crate::coat::gloss;
use crate::merge::blocks_of;
use crate::pixel_map::{PixelMap, PoseView};
use crate::reference::WhiteReference;
use crate::weights::Weights;

/// Columns without a weight from which on a run ends and another begins.
const GAP: usize = 2 * LANES;

/// A run on its way into a band.
struct Piece {
    row: u32,
    column: u32,
    bin: u32,
    weights: Vec<[f32; LANES]>,
    relative: [f32; 2],
}

impl Sweep {
    /// Puts together what the poses of a tilt share; `mean_cos_i` is the mean of cos θ' over the lamp.
    #[must_use]
    pub fn new(
        map: &PixelMap,
        view: &PoseView,
        weights: &Weights,
        white: &WhiteReference,
        mean_cos_i: f64,
    ) -> Self {
        let (width, height) = (map.width(), map.height());
        let per_rate = cells::per_rate(map, view, white, mean_cos_i);
        let variance = &white.relative_variance;
        let (pieces, known): (Vec<Vec<Piece>>, Vec<[Known; 3]>) = (0..weights.bins())
            .into_par_iter()
            .map(|bin| of_bin(weights, bin, width, &per_rate, variance))
            .unzip();
        let mut pieces: Vec<Piece> = pieces.into_iter().flatten().collect();
        pieces.par_sort_unstable_by_key(|p| (p.row, p.column, p.bin));
        let bands = (0..height.div_ceil(BAND))
            .into_par_iter()
            .map(|band| {
                let rows = band * BAND..((band + 1) * BAND).min(height);
                let from = pieces.partition_point(|p| (p.row as usize) < rows.start);
                let to = pieces.partition_point(|p| (p.row as usize) < rows.end);
                let blocks = rows.clone().map(|y| blocks_of(&view.visible[y * width..(y + 1) * width]));
                band_of(&pieces[from..to], rows.start, blocks.collect(), weights.bins())
            })
            .collect();
        let reached = gloss::reached(map, view);
        let (reached_cells, window) = window(weights, &reached, width, variance);
        Self {
            width,
            height,
            bands,
            known: known.into_iter().flatten().collect(),
            window,
            reached,
            reached_cells,
            per_rate,
            visible: view.visible.clone(),
            lit: view.visible.iter().filter(|v| **v).count(),
            channels: [0, 1].map(|row| [0, 1].map(|column| map.channel(row * width + column))),
        }
    }
}

/// The pixels that are looked at for a gloss, and those of all cells that one may hide something of.
fn window(
    weights: &Weights,
    reached: &gloss::Reached,
    width: usize,
    relative: &[f32],
) -> (Vec<usize>, Window) {
    let mut hidden = vec![false; relative.len()];
    for &p in &reached.hidden {
        hidden[p as usize] = true;
    }
    let cells = (0..weights.bins() / 2).into_par_iter().filter(|&cell| {
        let mut lists = [cell, weights.bins() / 2 + cell]
            .into_iter()
            .flat_map(|bin| (0..3).map(move |c| weights.list(bin, c).0));
        lists.any(|list| list.iter().any(|&p| hidden[p as usize]))
    });
    let cells: Vec<usize> = cells.collect();
    let in_cells = cells.iter().flat_map(|&cell| {
        [cell, weights.bins() / 2 + cell]
            .into_iter()
            .flat_map(|bin| (0..3).flat_map(move |c| weights.list(bin, c).0.iter()))
    });
    let all = reached.near.iter().chain(in_cells).map(|&p| p as usize);
    let window = Window::about(all, width, relative);
    (cells, window)
}

/// Runs of a bin, and what its weights sum up to.
fn of_bin(
    weights: &Weights,
    bin: usize,
    width: usize,
    per_rate: &[f32],
    variance: &[f32],
) -> (Vec<Piece>, [Known; 3]) {
    let mut known = [Known::default(); 3];
    let mut all: Vec<(u32, f32)> = Vec::new();
    for (channel, k) in known.iter_mut().enumerate() {
        let (pixels, ws) = weights.list(bin, channel);
        for (&p, &w) in pixels.iter().zip(ws) {
            let one = per_rate[p as usize];
            let weight = f64::from(w);
            k.all += weight.abs();
            if one > 0.0 {
                k.valid += weight.abs();
                k.w += weight;
                all.push((p, w * one));
            }
        }
    }
    all.sort_unstable_by_key(|e| e.0);
    let mut pieces: Vec<Piece> = Vec::new();
    // sums of w² and of w² times the relative variance, per parity of the column
    let mut squares = [[0.0f64; 2]; 2];
    let mut last = usize::MAX;
    for (p, w) in all {
        let (x, row) = (p as usize % width, p as usize / width);
        let goes_on = pieces.last().is_some_and(|piece| piece.row as usize == row && x - last < GAP);
        if !goes_on {
            close(&mut pieces, &mut squares);
            let column = (x & !1) as u32;
            pieces.push(Piece {
                row: row as u32,
                column,
                bin: bin as u32,
                weights: Vec::new(),
                relative: [0.0; 2],
            });
        }
        if let Some(piece) = pieces.last_mut() {
            let at = x - piece.column as usize;
            piece.weights.resize(piece.weights.len().max(at / LANES + 1), [0.0; LANES]);
            piece.weights[at / LANES][at % LANES] = w;
            let w2 = f64::from(w).powi(2);
            squares[x % 2][0] += w2;
            squares[x % 2][1] += w2 * f64::from(variance[p as usize]);
        }
        last = x;
    }
    close(&mut pieces, &mut squares);
    (pieces, known)
}

/// Writes the mean relative variance of the run that ends.
fn close(pieces: &mut [Piece], squares: &mut [[f64; 2]; 2]) {
    if let Some(piece) = pieces.last_mut() {
        piece.relative = squares.map(|[w2, sum]| if w2 > 0.0 { (sum / w2) as f32 } else { 0.0 });
    }
    *squares = [[0.0; 2]; 2];
}

fn band_of(pieces: &[Piece], first_row: usize, blocks: Vec<Vec<u32>>, bins: usize) -> Band {
    let mut band = Band { first_row, starts: vec![0], ..Band::default() };
    let mut slot_of = vec![u32::MAX; 2 * bins];
    let mut rest = pieces;
    for k in 0..blocks.len() {
        let row = (first_row + k) as u32;
        let n = rest.iter().take_while(|p| p.row == row).count();
        let (mine, others) = rest.split_at(n);
        rest = others;
        for piece in mine {
            let key = piece.bin as usize * 2 + row as usize % 2;
            if slot_of[key] == u32::MAX {
                slot_of[key] = band.slots.len() as u32;
                band.slots.push(Slot { bin: piece.bin, row_parity: row % 2 });
            }
            let first = band.weights.len() as u32;
            band.weights.extend_from_slice(&piece.weights);
            band.runs.push(Run {
                column: piece.column,
                slot: slot_of[key],
                first,
                end: band.weights.len() as u32,
                relative: piece.relative,
            });
        }
        band.starts.push(band.runs.len() as u32);
    }
    band.blocks = blocks;
    band
}
