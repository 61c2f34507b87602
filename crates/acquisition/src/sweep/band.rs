//! A band of rows: its runs, and the pass over it.

use super::window::Window;
use super::{LANES, Sweep};
use crate::cells::PixelValue;
use crate::merge::lanes::{BLOCK, Row};
use crate::merge::shots::Shots;
use crate::merge::wide::{Task, Wide};
use crate::merge::{Merged, mend};

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
    /// Blocks of each row that are seen.
    pub(super) blocks: Vec<Vec<u32>>,
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
    /// In rising order, what hot pixels of this band and of those beside it are mended from.
    pub(super) beside: Vec<(u32, Merged)>,
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

    /// Hot pixels of the band that see the sample; and in rising order the pixels of the band that these and those in rows beside the band are mended from.
    fn hot(&self, sweep: &Sweep, shots: &Shots<'_>) -> (Vec<u32>, Vec<u32>) {
        let (w, rows) = (sweep.width, self.first_row..self.first_row + self.blocks.len());
        let reach = mend::ASKED.iter().map(|a| a.1.unsigned_abs()).max().unwrap_or(0);
        let (mut mine, mut asked) = (Vec::new(), Vec::new());
        for &p in shots.dark.hot_between(rows.start.saturating_sub(reach) * w, (rows.end + reach) * w) {
            if !sweep.visible[p as usize] {
                continue;
            }
            let (x, y) = (p as usize % w, p as usize / w);
            if rows.contains(&y) {
                mine.push(p);
            }
            for (dx, dy) in mend::ASKED {
                let (Some(x), Some(y)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else {
                    continue;
                };
                let q = y * w + x;
                if x < w && rows.contains(&y) && sweep.visible[q] && !shots.dark.is_hot(q) {
                    asked.push(q as u32);
                }
            }
        }
        asked.sort_unstable();
        (mine, asked)
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
        let (hot, asked) = band.hot(sweep, shots);
        for (k, blocks) in band.blocks.iter().enumerate().filter(|(_, blocks)| !blocks.is_empty()) {
            let y = band.first_row + k;
            row.merge(wide, shots, y, blocks);
            let start = y * sweep.width;
            out.beside.extend(of_row(&asked, y, sweep.width).map(|x| ((start + x) as u32, row.pixel(x))));
            set_aside(&mut row, y, blocks, sweep, &hot, &mut out);
            keep(&row, y, &sweep.window, sweep, &mut out.window);
            for run in &band.runs[band.starts[k] as usize..band.starts[k + 1] as usize] {
                let weights = &band.weights[run.first as usize..run.end as usize];
                spread(wide, &row, run, weights, &mut sums[run.slot as usize]);
            }
        }
        out.sums = sums.iter().map(by_column).collect();
        out.hot = hot;
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

/// Takes what is rare out of the row, the `hot` pixels of the band among it: it counts as nothing in the sums and is put right afterwards.
fn set_aside(row: &mut Row, y: usize, blocks: &[u32], sweep: &Sweep, hot: &[u32], out: &mut Taken) {
    let w = sweep.width;
    for x in of_row(hot, y, w) {
        (row.rate[x], row.shot[x], row.read[x], row.dark[x]) = (0.0, 0.0, 0.0, 0.0);
    }
    for b in blocks.iter().map(|b| *b as usize).filter(|b| row.lost[*b]) {
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

/// Columns of those of some pixels in rising order that lie in a row.
fn of_row(pixels: &[u32], y: usize, width: usize) -> impl Iterator<Item = usize> {
    let first = pixels.partition_point(|&p| (p as usize) < y * width);
    pixels[first..].iter().map(move |&p| p as usize - y * width).take_while(move |x| *x < width)
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
