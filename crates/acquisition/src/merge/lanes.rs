//! The merge of one sensor row, thirty-two pixels a time, in a form that compilers turn into vector instructions.
//!
//! A block's exposures are classed first: clear of saturation in every pixel, saturated in every pixel, or mixed. Where no exposure is mixed
//! the weights are the same for all pixels of a colour in the block, so a pixel costs one multiplication and one addition an exposure, and the
//! parts of its variance are straight lines in its rate and its dark current. Only mixed blocks carry weights per pixel.
//!
//! The rate that the weights expect is the mean of the block's pixels of one colour in the longest exposure that is clear. Any weights that do
//! not depend on a pixel's own noise leave its rate without bias; near the best ones the variance is flat, so a mean over a few degrees serves,
//! and it is surer than the pixel's own counts.

use super::shots::{Ramp, Shots};

/// Pixels of a block.
pub(crate) const BLOCK: usize = 32;
/// Colours that alternate along a row.
const PARITIES: usize = 2;

/// A merged row in parts; what is not wanted holds finite numbers without meaning.
#[derive(Clone, Debug, Default)]
pub(crate) struct Row {
    /// Electrons per second at the nominal lamp; infinite where every exposure is saturated.
    pub(crate) rate: Vec<f32>,
    pub(crate) shot: Vec<f32>,
    pub(crate) read: Vec<f32>,
    pub(crate) dark: Vec<f32>,
    pub(crate) exposure: Vec<f32>,
    /// Blocks that hold a pixel which every exposure saturates.
    pub(crate) lost: Vec<bool>,
    scratch: Scratch,
}

#[derive(Clone, Debug, Default)]
struct Scratch {
    /// How each exposure serves each block, exposure by exposure.
    class: Vec<Class>,
    /// Per (block, parity): expected rate.
    expected: Vec<f32>,
    /// Per exposure and (block, parity): weight, not yet normalised.
    weights: Vec<f32>,
    /// Per (block, parity): Σ w x and the straight lines' coefficients.
    lines: [Vec<f32>; 8],
}

/// How an exposure serves a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Class {
    #[default]
    Clear,
    Mixed,
    Saturated,
}

// names of `Scratch::lines`
const DEN: usize = 0;
/// Σ w² x / den², the shot noise per rate.
const SHOT: usize = 1;
/// Σ w² t / den², the shot noise per dark current.
const DARK_SHOT: usize = 2;
/// Σ w² / den².
const SQUARES: usize = 3;
/// Σ w / den.
const SUM: usize = 4;
/// Σ w (t − t̄) / den.
const SUM_T: usize = 5;
/// Σ x.
const EXPOSURE: usize = 6;
/// What is left of zero counts.
const OFFSET: usize = 7;

impl Row {
    /// Room for a row of `width` pixels, with some to spare for what is read in lanes.
    pub(crate) fn of(width: usize) -> Self {
        let n = width.next_multiple_of(BLOCK) + BLOCK;
        let lane = || vec![0.0f32; n];
        Self {
            rate: lane(),
            shot: lane(),
            read: lane(),
            dark: lane(),
            exposure: lane(),
            lost: vec![false; width.div_ceil(BLOCK)],
            scratch: Scratch::default(),
        }
    }

    /// Merges the blocks of row `y` that `blocks` names (first, end).
    #[inline(always)]
    pub(crate) fn merge(&mut self, shots: &Shots<'_>, y: usize, blocks: (usize, usize)) {
        match &shots.ramp {
            Ramp::Straight { .. } => self.merge_with(shots, y, blocks, &|raw: u16| f32::from(raw)),
            Ramp::Table(table) => {
                let last = table.len().saturating_sub(1);
                let level = |raw: u16| table.get(usize::from(raw).min(last)).copied().unwrap_or(0.0);
                self.merge_with(shots, y, blocks, &level);
            }
        }
    }

    #[inline(always)]
    fn merge_with(
        &mut self,
        shots: &Shots<'_>,
        y: usize,
        (first, end): (usize, usize),
        level: &impl Fn(u16) -> f32,
    ) {
        if first >= end {
            return;
        }
        self.scratch.prepare(shots, y, (first, end), level);
        let row = y * shots.width;
        for b in first..end {
            let x = b * BLOCK;
            let n = BLOCK.min(shots.width - x);
            if self.scratch.mixed(shots.len(), b - first, end - first) {
                self.mixed_block(shots, y, b, (first, end), level);
                continue;
            }
            self.lost[b] = self.scratch.lines[DEN][(b - first) * PARITIES] <= 0.0;
            if n == BLOCK {
                self.clear_block::<BLOCK>(shots, row + x, x, (b - first, end - first), level);
            } else {
                // the last pixels of a row, one after the other
                for k in 0..n {
                    self.clear_block::<1>(shots, row + x + k, x + k, (b - first, end - first), level);
                }
            }
        }
    }

    /// N pixels from `x`; one, or a whole block.
    #[inline(always)]
    fn clear_block<const N: usize>(
        &mut self,
        shots: &Shots<'_>,
        p: usize,
        x: usize,
        (b, count): (usize, usize),
        level: &impl Fn(u16) -> f32,
    ) {
        let parity = |k: usize| b * PARITIES + ((x + k) & 1);
        let lines = &self.scratch.lines;
        let spread = |line: &[f32]| -> [f32; N] { std::array::from_fn(|k| line[parity(k)]) };
        let mean: &[f32; N] = take(shots.dark_mean, p);
        let current: &[f32; N] = take(shots.dark_current, p);
        let mut rate = spread(&lines[OFFSET]);
        let (sum, sum_t) = (spread(&lines[SUM]), spread(&lines[SUM_T]));
        for k in 0..N {
            rate[k] -= sum[k] * mean[k] + sum_t[k] * current[k];
        }
        let lanes = count * PARITIES;
        for (j, shot) in shots.list.iter().enumerate() {
            let w = spread(&self.scratch.weights[j * lanes..(j + 1) * lanes]);
            let raw: &[u16; N] = take(shot.raw, p);
            for k in 0..N {
                rate[k] += w[k] * level(raw[k]);
            }
        }
        let (slope, dark_slope) = (spread(&lines[SHOT]), spread(&lines[DARK_SHOT]));
        let (squares, exposure) = (spread(&lines[SQUARES]), spread(&lines[EXPOSURE]));
        for k in 0..N {
            self.rate[x + k] = rate[k];
            self.shot[x + k] = slope[k] * rate[k].max(0.0) + dark_slope[k] * current[k].max(0.0);
            self.read[x + k] = squares[k] * shots.read_e2;
            self.dark[x + k] =
                sum[k] * sum[k] * shots.dark_mean_e2 + sum_t[k] * sum_t[k] * shots.dark_current_e2;
            self.exposure[x + k] = exposure[k];
        }
        if lines[DEN][b * PARITIES] <= 0.0 {
            self.rate[x..x + N].fill(f32::INFINITY);
        }
    }

    /// A block in which some exposure is saturated in some pixels.
    fn mixed_block(
        &mut self,
        shots: &Shots<'_>,
        y: usize,
        b: usize,
        (first, end): (usize, usize),
        level: &impl Fn(u16) -> f32,
    ) {
        let x0 = b * BLOCK;
        let n = BLOCK.min(shots.width - x0);
        let (slope, offset) = shots.ramp.line();
        self.lost[b] = false;
        for x in x0..x0 + n {
            let p = y * shots.width + x;
            let (mean, current) = (shots.dark_mean[p], shots.dark_current[p]);
            let expected = self.scratch.expected[(b - first) * PARITIES + (x & 1)];
            let (mut num, mut den, mut sum, mut sum_t, mut exposure) =
                (0.0f32, 0.0f32, 0.0f32, 0.0f32, 0.0f32);
            let (mut by_rate, mut by_current, mut squares) = (0.0f32, 0.0f32, 0.0f32);
            for (j, shot) in shots.list.iter().enumerate() {
                let usable = match self.scratch.class[j * (end - first) + b - first] {
                    Class::Clear => true,
                    Class::Saturated => false,
                    Class::Mixed => shots.usable(shot.raw, p),
                };
                if !usable {
                    continue;
                }
                let w = shots.weight(shot, expected);
                let signal = slope * level(shot.raw[p]) + offset - mean - current * shot.since_mean_s;
                num += w * signal;
                den += w * shot.x;
                sum += w;
                sum_t += w * shot.since_mean_s;
                exposure += shot.x;
                by_rate += w * w * shot.x;
                by_current += w * w * shot.dark_s;
                squares += w * w;
            }
            if den <= 0.0 {
                self.lost[b] = true;
                self.rate[x] = f32::INFINITY;
                (self.shot[x], self.read[x], self.dark[x], self.exposure[x]) = (0.0, 0.0, 0.0, 0.0);
                continue;
            }
            let (rate, d2) = (num / den, den * den);
            self.rate[x] = rate;
            self.shot[x] = (by_rate * rate.max(0.0) + by_current * current.max(0.0)) / d2;
            self.read[x] = squares / d2 * shots.read_e2;
            self.dark[x] = (sum * sum * shots.dark_mean_e2 + sum_t * sum_t * shots.dark_current_e2) / d2;
            self.exposure[x] = exposure;
        }
    }
}

/// N entries from `at`; callers hold that there are so many.
#[inline(always)]
fn take<T, const N: usize>(from: &[T], at: usize) -> &[T; N] {
    from[at..].first_chunk().expect("a whole block within the frame")
}

impl Scratch {
    /// Classes, expected rates, weights and straight lines of the blocks of a row.
    #[inline(always)]
    fn prepare(
        &mut self,
        shots: &Shots<'_>,
        y: usize,
        (first, end): (usize, usize),
        level: &impl Fn(u16) -> f32,
    ) {
        let (count, lanes, n) = (end - first, (end - first) * PARITIES, shots.len());
        self.class.clear();
        self.class.resize(n * count, Class::Clear);
        self.expected.clear();
        self.expected.resize(lanes, 0.0);
        self.weights.clear();
        self.weights.resize(n * lanes, 0.0);
        for line in &mut self.lines {
            line.clear();
            line.resize(lanes, 0.0);
        }
        for b in 0..count {
            // an exposure is clear where a longer one is
            let mut clear = 0;
            for j in (0..n).rev() {
                let class = shots.class(y, (first + b) * BLOCK, shots.list[j].raw);
                if class == Class::Clear {
                    clear = j;
                    break;
                }
                self.class[j * count + b] = class;
            }
            let sums = block_means(shots, y, (first + b) * BLOCK, shots.list[clear].raw, level);
            for (parity, mean) in sums.into_iter().enumerate() {
                self.expected[b * PARITIES + parity] = shots.expected(&shots.list[clear], mean);
            }
        }
        let [den, by_rate, by_current, squares, sum, sum_t, exposure, offset] = &mut self.lines;
        for (j, shot) in shots.list.iter().enumerate() {
            let w = &mut self.weights[j * lanes..(j + 1) * lanes];
            let class = &self.class[j * count..(j + 1) * count];
            for (l, w) in w.iter_mut().enumerate() {
                let clear = if class[l / PARITIES] == Class::Clear { 1.0 } else { 0.0 };
                *w = clear * shots.weight(shot, self.expected[l]);
                let square = *w * *w;
                den[l] += *w * shot.x;
                by_rate[l] += square * shot.x;
                by_current[l] += square * shot.dark_s;
                squares[l] += square;
                sum[l] += *w;
                sum_t[l] += *w * shot.since_mean_s;
                exposure[l] += clear * shot.x;
            }
        }
        let (slope, zero) = shots.ramp.line();
        for l in 0..lanes {
            let one = 1.0 / den[l].max(f32::MIN_POSITIVE);
            by_rate[l] *= one * one;
            by_current[l] *= one * one;
            squares[l] *= one * one;
            sum[l] *= one;
            sum_t[l] *= one;
            offset[l] = sum[l] * zero;
            for j in 0..n {
                self.weights[j * lanes + l] *= one * slope;
            }
        }
    }

    /// Whether some exposure is saturated in some pixels of a block only.
    #[inline(always)]
    fn mixed(&self, exposures: usize, b: usize, count: usize) -> bool {
        (0..exposures).any(|j| self.class[j * count + b] == Class::Mixed)
    }
}

impl Shots<'_> {
    /// How an exposure serves the block at (x, y).
    #[inline(always)]
    fn class(&self, y: usize, x: usize, raw: &[u16]) -> Class {
        let (w, h) = (self.width, self.height);
        let (n, row) = (BLOCK.min(w - x), y * w);
        let highest = if n == BLOCK {
            take::<u16, BLOCK>(raw, row + x).iter().fold(0, |a, v| a.max(*v))
        } else {
            raw[row + x..row + x + n].iter().fold(0, |a, v| a.max(*v))
        };
        if highest < self.surely_below {
            return Class::Clear;
        }
        self.class_by_neighbours(y, x, raw, highest, h)
    }

    /// The same from the neighbourhoods: lowest and highest of all that they hold.
    fn class_by_neighbours(&self, y: usize, x: usize, raw: &[u16], highest: u16, h: usize) -> Class {
        let w = self.width;
        let (from, to) = (x.saturating_sub(2), (x + BLOCK + 2).min(w));
        let (mut low, mut high) = (u16::MAX, 0);
        for v in [y.wrapping_sub(2), y, y + 2].into_iter().filter(|v| *v < h) {
            for &r in &raw[v * w + from..v * w + to] {
                low = low.min(r);
                high = high.max(r);
            }
        }
        if highest < self.clipped && f32::from(high) < self.saturated {
            Class::Clear
        } else if f32::from(low) >= self.saturated || low >= self.clipped {
            Class::Saturated
        } else {
            Class::Mixed
        }
    }
}

/// Mean level of the block's pixels of either parity.
#[inline(always)]
fn block_means(
    shots: &Shots<'_>,
    y: usize,
    x: usize,
    raw: &[u16],
    level: &impl Fn(u16) -> f32,
) -> [f32; PARITIES] {
    let (w, n) = (shots.width, BLOCK.min(shots.width - x));
    let mut lanes = [0.0f32; 8];
    if n == BLOCK {
        let (chunks, _) = take::<u16, BLOCK>(raw, y * w + x).as_chunks::<8>();
        for c in chunks {
            for (lane, v) in lanes.iter_mut().zip(c) {
                *lane += level(*v);
            }
        }
    } else {
        for k in 0..n {
            lanes[k % 2] += level(raw[y * w + x + k]);
        }
    }
    let of = |parity: usize| n.div_ceil(PARITIES).max(1) as f32 - (n & parity) as f32;
    let even = (lanes[0] + lanes[4]) + (lanes[2] + lanes[6]);
    let odd = (lanes[1] + lanes[5]) + (lanes[3] + lanes[7]);
    [even / of(0), odd / of(1).max(1.0)]
}
