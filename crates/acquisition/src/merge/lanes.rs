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
/// Pixels that are merged together where exposures are mixed.
const MIXED: usize = 8;
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
    /// Exposure by exposure, how it serves each (block, parity).
    class: Vec<Class>,
    /// Per (block, parity): expected rate.
    expected: Vec<f32>,
    /// Per exposure and (block, parity): weight, and the same for clear exposures over Σ w x, per raw value.
    free: Vec<f32>,
    weights: Vec<f32>,
    /// Whether a block is mixed in some exposure.
    mixed: Vec<bool>,
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
            if self.scratch.mixed[b - first] {
                self.lost[b] = false;
                let place = (b - first, end - first);
                for k in (0..n / MIXED).map(|k| k * MIXED) {
                    self.mixed_pixels::<MIXED>(shots, y, x + k, place, level);
                }
                for k in n / MIXED * MIXED..n {
                    self.mixed_pixels::<1>(shots, y, x + k, place, level);
                }
                continue;
            }
            let den = take::<f32, PARITIES>(&self.scratch.lines[DEN], (b - first) * PARITIES);
            self.lost[b] = den[0] <= 0.0 || den[1] <= 0.0;
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
        let lines = &self.scratch.lines;
        let at = |line: &[f32]| spread::<N>(line, b, x);
        let mean: &[f32; N] = take(shots.dark_mean, p);
        let current: &[f32; N] = take(shots.dark_current, p);
        let mut rate = at(&lines[OFFSET]);
        let (sum, sum_t) = (at(&lines[SUM]), at(&lines[SUM_T]));
        for k in 0..N {
            rate[k] -= sum[k] * mean[k] + sum_t[k] * current[k];
        }
        let lanes = count * PARITIES;
        for (j, shot) in shots.list.iter().enumerate() {
            let w = at(&self.scratch.weights[j * lanes..(j + 1) * lanes]);
            let raw: &[u16; N] = take(shot.raw, p);
            for k in 0..N {
                rate[k] += w[k] * level(raw[k]);
            }
        }
        let (slope, dark_slope) = (at(&lines[SHOT]), at(&lines[DARK_SHOT]));
        let (squares, exposure) = (at(&lines[SQUARES]), at(&lines[EXPOSURE]));
        let shot = place::<N>(&mut self.shot, x);
        for k in 0..N {
            shot[k] = slope[k] * rate[k].max(0.0) + dark_slope[k] * current[k].max(0.0);
        }
        let read = place::<N>(&mut self.read, x);
        for k in 0..N {
            read[k] = squares[k] * shots.read_e2;
        }
        let dark = place::<N>(&mut self.dark, x);
        for k in 0..N {
            dark[k] = sum[k] * sum[k] * shots.dark_mean_e2 + sum_t[k] * sum_t[k] * shots.dark_current_e2;
        }
        *place::<N>(&mut self.exposure, x) = exposure;
        let den = at(&lines[DEN]);
        for k in 0..N {
            rate[k] = if den[k] > 0.0 { rate[k] } else { f32::INFINITY };
        }
        *place::<N>(&mut self.rate, x) = rate;
    }

    /// N pixels from `x` of a block in which some exposure is saturated in some pixels.
    #[inline(always)]
    fn mixed_pixels<const N: usize>(
        &mut self,
        shots: &Shots<'_>,
        y: usize,
        x: usize,
        (b, count): (usize, usize),
        level: &impl Fn(u16) -> f32,
    ) {
        let (p, lanes) = (y * shots.width + x, count * PARITIES);
        let mean: &[f32; N] = take(shots.dark_mean, p);
        let current: &[f32; N] = take(shots.dark_current, p);
        let (slope, offset) = shots.ramp.line();
        let zero = [0.0f32; N];
        let (mut num, mut den, mut sum, mut sum_t, mut exposure) = (zero, zero, zero, zero, zero);
        let (mut by_rate, mut by_current, mut squares) = (zero, zero, zero);
        for (j, shot) in shots.list.iter().enumerate() {
            let class: &[Class; PARITIES] = take(&self.scratch.class, j * lanes + b * PARITIES);
            if *class == [Class::Saturated; PARITIES] {
                continue;
            }
            let usable = if class.contains(&Class::Mixed) { shots.usable::<N>(shot.raw, x, y) } else { zero };
            let clear = spread::<N>(&class.map(|c| f32::from(c == Class::Clear)), 0, x);
            let mixed = spread::<N>(&class.map(|c| f32::from(c == Class::Mixed)), 0, x);
            let free = spread::<N>(&self.scratch.free[j * lanes..(j + 1) * lanes], b, x);
            let raw: &[u16; N] = take(shot.raw, p);
            for k in 0..N {
                let counts = clear[k] + mixed[k] * usable[k];
                let w = counts * free[k];
                let signal = slope * level(raw[k]) + offset - mean[k] - current[k] * shot.since_mean_s;
                num[k] += w * signal;
                den[k] += w * shot.x;
                sum[k] += w;
                sum_t[k] += w * shot.since_mean_s;
                exposure[k] += counts * shot.x;
                by_rate[k] += w * w * shot.x;
                by_current[k] += w * w * shot.dark_s;
                squares[k] += w * w;
            }
        }
        let mut lost = false;
        for k in 0..N {
            let known = den[k] > 0.0;
            lost |= !known;
            let one = if known { 1.0 / den[k] } else { 0.0 };
            num[k] = if known { num[k] * one } else { f32::INFINITY };
            let square = one * one;
            sum[k] =
                (sum[k] * sum[k] * shots.dark_mean_e2 + sum_t[k] * sum_t[k] * shots.dark_current_e2) * square;
            squares[k] *= square * shots.read_e2;
            let rate = if known { num[k].max(0.0) } else { 0.0 };
            by_rate[k] = (by_rate[k] * rate + by_current[k] * current[k].max(0.0)) * square;
        }
        *place::<N>(&mut self.rate, x) = num;
        *place::<N>(&mut self.shot, x) = by_rate;
        *place::<N>(&mut self.read, x) = squares;
        *place::<N>(&mut self.dark, x) = sum;
        *place::<N>(&mut self.exposure, x) = exposure;
        self.lost[x / BLOCK] |= lost;
    }
}

/// N entries from `at`; callers hold that there are so many.
#[inline(always)]
fn take<T, const N: usize>(from: &[T], at: usize) -> &[T; N] {
    from[at..].first_chunk().expect("a whole block within the frame")
}

/// Room for N entries from `at`.
#[inline(always)]
fn place<const N: usize>(from: &mut [f32], at: usize) -> &mut [f32; N] {
    from[at..].first_chunk_mut().expect("room for a row and more")
}

/// The block's two values of a line, alternating as the pixels from column `x` do.
#[inline(always)]
fn spread<const N: usize>(line: &[f32], b: usize, x: usize) -> [f32; N] {
    let [even, odd] = *take::<f32, PARITIES>(line, b * PARITIES);
    let [first, second] = if x & 1 == 0 { [even, odd] } else { [odd, even] };
    std::array::from_fn(|k| if k & 1 == 0 { first } else { second })
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
        self.class.resize(n * lanes, Class::Clear);
        self.expected.clear();
        self.expected.resize(lanes, 0.0);
        self.mixed.clear();
        self.mixed.resize(count, false);
        for w in [&mut self.weights, &mut self.free] {
            w.clear();
            w.resize(n * lanes, 0.0);
        }
        for line in &mut self.lines {
            line.clear();
            line.resize(lanes, 0.0);
        }
        for b in 0..count {
            let x = (first + b) * BLOCK;
            // an exposure is clear where a longer one is
            let mut clear: [Option<usize>; PARITIES] = [None; PARITIES];
            for j in (0..n).rev() {
                let class = shots.class(y, x, shots.list[j].raw);
                for parity in 0..PARITIES {
                    if clear[parity].is_none() {
                        self.class[j * lanes + b * PARITIES + parity] = class[parity];
                        self.mixed[b] |= class[parity] == Class::Mixed;
                        clear[parity] = (class[parity] == Class::Clear).then_some(j);
                    }
                }
                if clear.iter().all(Option::is_some) {
                    break;
                }
            }
            let [even, odd] = clear.map(|j| j.unwrap_or(0));
            let mut means = block_means(shots, y, x, shots.list[even].raw, level);
            if odd != even {
                means[1] = block_means(shots, y, x, shots.list[odd].raw, level)[1];
            }
            self.expected[b * PARITIES] = shots.expected(&shots.list[even], means[0]);
            self.expected[b * PARITIES + 1] = shots.expected(&shots.list[odd], means[1]);
        }
        let [den, by_rate, by_current, squares, sum, sum_t, exposure, offset] =
            self.lines.each_mut().map(|line| &mut line[..lanes]);
        let expected = &self.expected[..lanes];
        for (j, shot) in shots.list.iter().enumerate() {
            let range = j * lanes..(j + 1) * lanes;
            let (w, free) = (&mut self.weights[range.clone()], &mut self.free[range.clone()]);
            let class = &self.class[range];
            for l in 0..lanes {
                let clear = f32::from(class[l] == Class::Clear);
                free[l] = shots.weight(shot, expected[l]);
                w[l] = clear * free[l];
                let square = w[l] * w[l];
                den[l] += w[l] * shot.x;
                by_rate[l] += square * shot.x;
                by_current[l] += square * shot.dark_s;
                squares[l] += square;
                sum[l] += w[l];
                sum_t[l] += w[l] * shot.since_mean_s;
                exposure[l] += clear * shot.x;
            }
        }
        let (slope, zero) = shots.ramp.line();
        for l in 0..lanes {
            let one = if den[l] > 0.0 { 1.0 / den[l] } else { 0.0 };
            by_rate[l] *= one * one;
            by_current[l] *= one * one;
            squares[l] *= one * one;
            sum[l] *= one;
            sum_t[l] *= one;
            offset[l] = sum[l] * zero;
        }
        for w in self.weights.chunks_exact_mut(lanes) {
            for l in 0..lanes {
                w[l] *= if den[l] > 0.0 { slope / den[l] } else { 0.0 };
            }
        }
    }
}

impl Shots<'_> {
    /// How an exposure serves the block at (x, y), its even and its odd columns.
    #[inline(always)]
    fn class(&self, y: usize, x: usize, raw: &[u16]) -> [Class; PARITIES] {
        let (w, h) = (self.width, self.height);
        let row = y * w;
        if x + BLOCK > w {
            return self.class_by_neighbours(y, x, raw);
        }
        let own = Extremes::default().with(take(raw, row + x));
        let (low, high) = own.by_parity();
        if high[0] < self.surely_below && high[1] < self.surely_below {
            return [Class::Clear; PARITIES];
        }
        if low[0] >= self.clipped && low[1] >= self.clipped {
            return [Class::Saturated; PARITIES];
        }
        if x < 2 || x + BLOCK + 2 > w || y < 2 || y + 2 >= h {
            return self.class_by_neighbours(y, x, raw);
        }
        let mut around = own;
        for v in [row - 2 * w, row, row + 2 * w] {
            around = around.with(take(raw, v + x - 2)).with(take(raw, v + x + 2));
        }
        self.judge((low, high), around.by_parity())
    }

    /// The same at the edges of the sensor.
    fn class_by_neighbours(&self, y: usize, x: usize, raw: &[u16]) -> [Class; PARITIES] {
        let (w, h) = (self.width, self.height);
        let of = |rows: &[usize], from: usize, to: usize| {
            let (mut low, mut high) = ([u16::MAX; PARITIES], [0; PARITIES]);
            for v in rows.iter().filter(|v| **v < h) {
                for u in from..to {
                    let r = raw[v * w + u];
                    low[u & 1] = low[u & 1].min(r);
                    high[u & 1] = high[u & 1].max(r);
                }
            }
            (low, high)
        };
        let own = of(&[y], x, (x + BLOCK).min(w));
        let rows = [y.wrapping_sub(2), y, y + 2];
        self.judge(own, of(&rows, x.saturating_sub(2), (x + BLOCK + 2).min(w)))
    }

    /// Lowest and highest of the block's own pixels and of all neighbourhoods.
    #[inline(always)]
    fn judge(
        &self,
        (own_low, own_high): ([u16; PARITIES], [u16; PARITIES]),
        (low, high): ([u16; PARITIES], [u16; PARITIES]),
    ) -> [Class; PARITIES] {
        [0, 1].map(|k| {
            if own_high[k] < self.surely_below
                || (own_high[k] < self.clipped && f32::from(high[k]) < self.saturated)
            {
                Class::Clear
            } else if f32::from(low[k]) >= self.saturated || own_low[k] >= self.clipped {
                Class::Saturated
            } else {
                Class::Mixed
            }
        })
    }
}

/// Lowest and highest value, lane by lane.
#[derive(Clone, Copy)]
struct Extremes {
    low: [u16; 16],
    high: [u16; 16],
}

impl Default for Extremes {
    #[inline(always)]
    fn default() -> Self {
        Self { low: [u16::MAX; 16], high: [0; 16] }
    }
}

impl Extremes {
    #[inline(always)]
    fn with(mut self, values: &[u16; BLOCK]) -> Self {
        let (halves, _) = values.as_chunks::<16>();
        for half in halves {
            for (k, v) in half.iter().enumerate() {
                self.low[k] = self.low[k].min(*v);
                self.high[k] = self.high[k].max(*v);
            }
        }
        self
    }

    #[inline(always)]
    fn by_parity(&self) -> ([u16; PARITIES], [u16; PARITIES]) {
        let (mut low, mut high) = (self.low, self.high);
        for half in [8, 4, 2] {
            for k in 0..half {
                low[k] = low[k].min(low[k + half]);
                high[k] = high[k].max(high[k + half]);
            }
        }
        ([low[0], low[1]], [high[0], high[1]])
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
