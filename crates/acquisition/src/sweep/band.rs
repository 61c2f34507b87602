//! A band of rows: its runs, and the pass over it.

use super::window::Window;
use super::{LANES, Sweep};
use crate::cells::PixelValue;
use crate::merge::lanes::{BLOCK, Row};
use crate::merge::shots::Shots;
use crate::merge::wide::{Task, Wide};

/// A stretch of pixels of one row in one bin, from an even column on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub(super) column: u32,
    /// Among the band's slots.
    pub(super) slot: u32,
    /// First and end among the band's weights, in lanes.
    pub(super) first: u32,
    pub(super) end: u32,
    /// Relative variance of the white reference's pixels, mean over the run's even and odd columns.
    pub(super) relative: [f32; 2],
}

/// Where a run's sums go: a bin, and the parity of the row, which says what colours even and odd columns are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Slot {
    pub(super) bin: u32,
    pub(super) row_parity: u32,
}

/// Rows that are swept together.
#[derive(Clone, Debug, Default)]
pub(super) struct Band {
    pub(super) first_row: usize,
    /// First and end of the blocks of each row that are seen.
    pub(super) blocks: Vec<(usize, usize)>,
    /// Start of each row's runs, and the end of the last.
    pub(super) starts: Vec<u32>,
    pub(super) runs: Vec<Run>,
    pub(super) weights: Vec<[f32; LANES]>,
    pub(super) slots: Vec<Slot>,
}

/// What a pass over a band gives.
#[derive(Clone, Debug, Default)]
pub(super) struct Taken {
    /// Per slot and column parity: value, shot, read, dark, reference.
    pub(super) sums: Vec<[[f64; 5]; 2]>,
    pub(super) window: Vec<(u32, PixelValue)>,
    /// Pixels that every exposure saturates.
    pub(super) lost: Vec<u32>,
    /// Hot pixels, not yet in the sums.
    pub(super) hot: Vec<u32>,
}

/// Sums of a slot, lane by lane.
#[derive(Clone, Copy, Default)]
struct Lanes {
    value: [f32; LANES],
    shot: [f32; LANES],
    read: [f32; LANES],
    dark: [f32; LANES],
    reference: [f32; LANES],
}

/// A pass over a band.
pub(super) struct Pass<'a, 'b> {
    band: &'a Band,
    sweep: &'a Sweep,
    shots: &'a Shots<'b>,
}

impl Band {
    pub(super) const fn task<'a, 'b>(&'a self, sweep: &'a Sweep, shots: &'a Shots<'b>) -> Pass<'a, 'b> {
        Pass { band: self, sweep, shots }
    }

    /// Calls `f` with the bin, the weight and the reference's relative variance of every run that holds pixel `p`.
    pub(super) fn each(&self, width: usize, p: usize, f: &mut impl FnMut(usize, f32, f32)) {
        let (x, row) = (p % width, p / width - self.first_row);
        for run in &self.runs[self.starts[row] as usize..self.starts[row + 1] as usize] {
            let Some(at) = x.checked_sub(run.column as usize) else { continue };
            let group = run.first as usize + at / LANES;
            if group >= run.end as usize {
                continue;
            }
            let weight = self.weights[group][at % LANES];
            if weight != 0.0 {
                f(self.slots[run.slot as usize].bin as usize, weight, run.relative[x % 2]);
            }
        }
    }
}

impl Task for Pass<'_, '_> {
    type Output = Taken;

    #[inline(always)]
    fn run<W: Wide>(self, wide: W) -> Taken {
        let Self { band, sweep, shots } = self;
        let mut row = Row::of(sweep.width);
        let mut sums = vec![Lanes::default(); band.slots.len()];
        let mut out = Taken::default();
        for (k, &blocks) in band.blocks.iter().enumerate() {
            if blocks.0 >= blocks.1 {
                continue;
            }
            let y = band.first_row + k;
            row.merge(wide, shots, y, blocks);
            set_aside(&mut row, y, blocks, sweep, shots, &mut out);
            keep(&row, y, &sweep.window, sweep, &mut out.window);
            for run in &band.runs[band.starts[k] as usize..band.starts[k + 1] as usize] {
                let weights = &band.weights[run.first as usize..run.end as usize];
                spread(wide, &row, run, weights, &mut sums[run.slot as usize]);
            }
        }
        out.sums = sums.iter().map(by_column).collect();
        out
    }
}

/// Dot products of a run.
#[inline(always)]
fn spread<W: Wide>(w: W, row: &Row, run: &Run, weights: &[[f32; LANES]], into: &mut Lanes) {
    let x = run.column as usize;
    let n = weights.len() * LANES;
    let (rate, _) = row.rate[x..x + n].as_chunks::<LANES>();
    let (shot, _) = row.shot[x..x + n].as_chunks::<LANES>();
    let (read, _) = row.read[x..x + n].as_chunks::<LANES>();
    let (dark, _) = row.dark[x..x + n].as_chunks::<LANES>();
    let zero = w.splat(0.0);
    let mut sums = [zero; 5];
    for ((((weight, rate), shot), read), dark) in weights.iter().zip(rate).zip(shot).zip(read).zip(dark) {
        let weight = w.load(weight);
        let (t, square) = (w.mul(weight, w.load(rate)), w.mul(weight, weight));
        sums[0] = w.add(sums[0], t);
        sums[1] = w.add(sums[1], w.mul(square, w.load(shot)));
        sums[2] = w.add(sums[2], w.mul(square, w.load(read)));
        sums[3] = w.add(sums[3], w.mul(square, w.load(dark)));
        sums[4] = w.add(sums[4], w.mul(t, t));
    }
    sums[4] = w.mul(sums[4], w.pattern(run.relative));
    let all = [&mut into.value, &mut into.shot, &mut into.read, &mut into.dark, &mut into.reference];
    for (total, sum) in all.into_iter().zip(sums) {
        *total = w.store(w.add(w.load(total), sum));
    }
}

fn by_column(lanes: &Lanes) -> [[f64; 5]; 2] {
    [0, 1].map(|column| {
        [&lanes.value, &lanes.shot, &lanes.read, &lanes.dark, &lanes.reference]
            .map(|l| l.iter().skip(column).step_by(2).map(|v| f64::from(*v)).sum())
    })
}

/// Takes what is rare out of the row: it counts as nothing in the sums and is put right afterwards.
fn set_aside(
    row: &mut Row,
    y: usize,
    blocks: (usize, usize),
    sweep: &Sweep,
    shots: &Shots<'_>,
    out: &mut Taken,
) {
    let w = sweep.width;
    let (from, to) = (blocks.0 * BLOCK, (blocks.1 * BLOCK).min(w));
    for &p in shots.dark.hot_between(y * w + from, y * w + to) {
        let x = p as usize - y * w;
        if sweep.visible[p as usize] {
            out.hot.push(p);
        }
        (row.rate[x], row.shot[x], row.read[x], row.dark[x]) = (0.0, 0.0, 0.0, 0.0);
    }
    for b in (blocks.0..blocks.1).filter(|b| row.lost[*b]) {
        // what fills the last lanes up included
        for x in b * BLOCK..(b + 1) * BLOCK {
            if row.rate[x] != f32::INFINITY {
                continue;
            }
            if x < w && sweep.visible[y * w + x] {
                out.lost.push((y * w + x) as u32);
            }
            (row.rate[x], row.shot[x], row.read[x], row.dark[x]) = (0.0, 0.0, 0.0, 0.0);
        }
    }
}

/// Keeps the row's part of the window.
fn keep(row: &Row, y: usize, window: &Window, sweep: &Sweep, out: &mut Vec<(u32, PixelValue)>) {
    if !window.rows().contains(&y) {
        return;
    }
    for x in window.columns() {
        let p = y * sweep.width + x;
        if sweep.visible[p] {
            out.push((p as u32, window.value(p, sweep.per_rate[p], &row.pixel(x))));
        }
    }
}
