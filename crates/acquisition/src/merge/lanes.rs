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
use super::wide::{WIDE, Wide};

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
    pub(crate) fn merge<W: Wide>(&mut self, wide: W, shots: &Shots<'_>, y: usize, blocks: (usize, usize)) {
        match &shots.ramp {
            Ramp::Straight { .. } => {
                self.merge_with(wide, shots, y, blocks, &|raw: &[u16; WIDE]| wide.counts(raw));
            }
            Ramp::Table(table) => {
                let last = table.len().saturating_sub(1);
                let level = |raw: u16| table.get(usize::from(raw).min(last)).copied().unwrap_or(0.0);
                self.merge_with(wide, shots, y, blocks, &|raw: &[u16; WIDE]| wide.load(&raw.map(level)));
            }
        }
    }

    #[inline(always)]
    fn merge_with<W: Wide>(
        &mut self,
        wide: W,
        shots: &Shots<'_>,
        y: usize,
        (first, end): (usize, usize),
        level: &impl Fn(&[u16; WIDE]) -> W::F,
    ) {
        if first >= end {
            return;
        }
        self.scratch.prepare(wide, shots, y, (first, end), level);
        for b in first..end {
            let (x, place) = (b * BLOCK, (b - first, end - first));
            let to = shots.width.min(x + BLOCK);
            self.lost[b] = false;
            if self.scratch.mixed[b - first] {
                for x in (x..to).step_by(WIDE) {
                    if x + WIDE <= shots.width {
                        self.mixed::<W, true>(wide, shots, y, x, place, level);
                    } else {
                        self.mixed::<W, false>(wide, shots, y, x, place, level);
                    }
                }
            } else if x + BLOCK <= shots.width {
                self.clear::<W, true>(wide, shots, y, x, place, level);
            } else {
                self.clear::<W, false>(wide, shots, y, x, place, level);
            }
        }
    }

    /// The pixels from `x` of a block in which no exposure is mixed; `WHOLE` where the row does not end within it.
    #[inline(always)]
    fn clear<W: Wide, const WHOLE: bool>(
        &mut self,
        wide: W,
        shots: &Shots<'_>,
        y: usize,
        start: usize,
        (b, count): (usize, usize),
        level: &impl Fn(&[u16; WIDE]) -> W::F,
    ) {
        let w = wide;
        let lines = &self.scratch.lines;
        let den: [f32; PARITIES] = *take(&lines[DEN], b * PARITIES);
        self.lost[start / BLOCK] = den[0] <= 0.0 || den[1] <= 0.0;
        let den = w.pattern(den);
        let line = |k: usize| w.pattern(*take(&lines[k], b * PARITIES));
        let (offset, sum, sum_t) = (line(OFFSET), line(SUM), line(SUM_T));
        let (by_rate, by_current, exposure) = (line(SHOT), line(DARK_SHOT), line(EXPOSURE));
        let read = w.mul(line(SQUARES), w.splat(shots.read_e2));
        let dark = w.add(
            w.mul(w.mul(sum, sum), w.splat(shots.dark_mean_e2)),
            w.mul(w.mul(sum_t, sum_t), w.splat(shots.dark_current_e2)),
        );
        let lanes = count * PARITIES;
        for x in (start..start + BLOCK).step_by(WIDE) {
            if !WHOLE && x >= shots.width {
                break;
            }
            let p = y * shots.width + x;
            let n = if WHOLE { WIDE } else { WIDE.min(shots.width - x) };
            let mean = w.load(&some::<_, WHOLE>(shots.dark_mean, p, n));
            let current = w.load(&some::<_, WHOLE>(shots.dark_current, p, n));
            let mut rate = w.sub(offset, w.add(w.mul(sum, mean), w.mul(sum_t, current)));
            for (j, shot) in shots.list.iter().enumerate() {
                let weight = w.pattern(*take(&self.scratch.weights, j * lanes + b * PARITIES));
                rate = w.add(rate, w.mul(weight, level(&some::<_, WHOLE>(shot.raw, p, n))));
            }
            let shot = w.add(w.mul(by_rate, w.positive(rate)), w.mul(by_current, w.positive(current)));
            let rate = w.where_above_zero(den, rate, w.splat(f32::INFINITY));
            self.put(w, x, [rate, shot, read, dark, exposure]);
        }
    }

    #[inline(always)]
    fn put<W: Wide>(&mut self, w: W, x: usize, [rate, shot, read, dark, exposure]: [W::F; 5]) {
        *place(&mut self.rate, x) = w.store(rate);
        *place(&mut self.shot, x) = w.store(shot);
        *place(&mut self.read, x) = w.store(read);
        *place(&mut self.dark, x) = w.store(dark);
        *place(&mut self.exposure, x) = w.store(exposure);
    }

    /// Eight pixels from `x` of a block in which some exposure is saturated in some pixels.
    #[inline(always)]
    fn mixed<W: Wide, const WHOLE: bool>(
        &mut self,
        wide: W,
        shots: &Shots<'_>,
        y: usize,
        x: usize,
        (b, count): (usize, usize),
        level: &impl Fn(&[u16; WIDE]) -> W::F,
    ) {
        let (w, p) = (wide, y * shots.width + x);
        let n = if WHOLE { WIDE } else { WIDE.min(shots.width - x) };
        let lanes = count * PARITIES;
        let mean = w.load(&some::<_, WHOLE>(shots.dark_mean, p, n));
        let current = w.load(&some::<_, WHOLE>(shots.dark_current, p, n));
        let (slope, offset) = shots.ramp.line();
        let (slope, offset) = (w.splat(slope), w.splat(offset));
        let zero = w.splat(0.0);
        let (mut num, mut den, mut sum, mut sum_t, mut exposure) = (zero, zero, zero, zero, zero);
        let (mut by_rate, mut by_current, mut squares) = (zero, zero, zero);
        for (j, shot) in shots.list.iter().enumerate() {
            let class: &[Class; PARITIES] = take(&self.scratch.class, j * lanes + b * PARITIES);
            if *class == [Class::Saturated; PARITIES] {
                continue;
            }
            let usable = if class.contains(&Class::Mixed) { shots.usable(w, shot.raw, x, y) } else { zero };
            let clear = w.pattern(class.map(|c| f32::from(c == Class::Clear)));
            let mixed = w.pattern(class.map(|c| f32::from(c == Class::Mixed)));
            let free = w.pattern(*take(&self.scratch.free, j * lanes + b * PARITIES));
            let (t, since) = (w.splat(shot.x), w.splat(shot.since_mean_s));
            let counts = w.add(clear, w.mul(mixed, usable));
            let weight = w.mul(counts, free);
            let electrons = w.add(w.mul(slope, level(&some::<_, WHOLE>(shot.raw, p, n))), offset);
            let signal = w.sub(electrons, w.add(mean, w.mul(current, since)));
            let square = w.mul(weight, weight);
            num = w.add(num, w.mul(weight, signal));
            den = w.add(den, w.mul(weight, t));
            sum = w.add(sum, weight);
            sum_t = w.add(sum_t, w.mul(weight, since));
            exposure = w.add(exposure, w.mul(counts, t));
            by_rate = w.add(by_rate, w.mul(square, t));
            by_current = w.add(by_current, w.mul(square, w.splat(shot.dark_s)));
            squares = w.add(squares, square);
        }
        let one = w.where_above_zero(den, w.div(w.splat(1.0), den), zero);
        let square = w.mul(one, one);
        let known = w.mul(num, one);
        let dark = w.add(
            w.mul(w.mul(sum, sum), w.splat(shots.dark_mean_e2)),
            w.mul(w.mul(sum_t, sum_t), w.splat(shots.dark_current_e2)),
        );
        let shot = w.add(w.mul(by_rate, w.positive(known)), w.mul(by_current, w.positive(current)));
        let rate = w.where_above_zero(den, known, w.splat(f32::INFINITY));
        self.lost[x / BLOCK] |= w.store(den).iter().any(|d| *d <= 0.0);
        let read = w.mul(squares, w.splat(shots.read_e2));
        self.put(w, x, [rate, w.mul(shot, square), w.mul(read, square), w.mul(dark, square), exposure]);
    }
}

/// N entries from `at`; callers hold that there are so many.
#[inline(always)]
fn take<T, const N: usize>(from: &[T], at: usize) -> &[T; N] {
    from[at..].first_chunk().expect("a whole block within the frame")
}

/// Eight entries from `at`, of which the first `n` are there (all of them where `WHOLE`).
#[inline(always)]
pub(crate) fn some<T: Copy + Default, const WHOLE: bool>(from: &[T], at: usize, n: usize) -> [T; WIDE] {
    if WHOLE {
        return *take(from, at);
    }
    std::array::from_fn(|k| if k < n { from[at + k] } else { T::default() })
}

/// Room for eight entries from `at`.
#[inline(always)]
fn place(from: &mut [f32], at: usize) -> &mut [f32; WIDE] {
    from[at..].first_chunk_mut().expect("room for a row and more")
}

impl Scratch {
    /// Classes, expected rates, weights and straight lines of the blocks of a row.
    #[inline(always)]
    fn prepare<W: Wide>(
        &mut self,
        wide: W,
        shots: &Shots<'_>,
        y: usize,
        (first, end): (usize, usize),
        level: &impl Fn(&[u16; WIDE]) -> W::F,
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
                let class = shots.class(wide, y, x, shots.list[j].raw);
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
            let mut means = block_means(wide, shots, y, x, shots.list[even].raw, level);
            if odd != even {
                means[1] = block_means(wide, shots, y, x, shots.list[odd].raw, level)[1];
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
    fn class<W: Wide>(&self, wide: W, y: usize, x: usize, raw: &[u16]) -> [Class; PARITIES] {
        let (w, h) = (self.width, self.height);
        let row = y * w;
        if x + BLOCK > w {
            return self.class_by_neighbours(y, x, raw);
        }
        let own = Extremes::of(wide, take(raw, row + x));
        let (low, high) = own.by_parity(wide);
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
            around = around.with(wide, take(raw, v + x - 2)).with(wide, take(raw, v + x + 2));
        }
        self.judge((low, high), around.by_parity(wide))
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
struct Extremes<W: Wide> {
    low: W::U,
    high: W::U,
}

impl<W: Wide> Extremes<W> {
    #[inline(always)]
    fn of(w: W, values: &[u16; BLOCK]) -> Self {
        let [a, b] = halves(values).map(|h| w.load_counts(h));
        Self { low: w.least(a, b), high: w.most(a, b) }
    }

    #[inline(always)]
    fn with(self, w: W, values: &[u16; BLOCK]) -> Self {
        let other = Self::of(w, values);
        Self { low: w.least(self.low, other.low), high: w.most(self.high, other.high) }
    }

    #[inline(always)]
    fn by_parity(&self, w: W) -> ([u16; PARITIES], [u16; PARITIES]) {
        let (low, high) = (w.store_counts(self.low), w.store_counts(self.high));
        let of = |k: usize| {
            let step = || (k..2 * WIDE).step_by(PARITIES);
            (
                step().fold(u16::MAX, |a, i| if low[i] < a { low[i] } else { a }),
                step().fold(0, |a, i| if high[i] > a { high[i] } else { a }),
            )
        };
        let (even, odd) = (of(0), of(1));
        ([even.0, odd.0], [even.1, odd.1])
    }
}

#[inline(always)]
fn halves(values: &[u16; BLOCK]) -> [&[u16; 2 * WIDE]; 2] {
    [take(values, 0), take(values, 2 * WIDE)]
}

/// Mean level of the block's pixels of either parity.
#[inline(always)]
fn block_means<W: Wide>(
    wide: W,
    shots: &Shots<'_>,
    y: usize,
    x: usize,
    raw: &[u16],
    level: &impl Fn(&[u16; WIDE]) -> W::F,
) -> [f32; PARITIES] {
    let (p, n) = (y * shots.width + x, BLOCK.min(shots.width - x));
    let mut lanes = wide.splat(0.0);
    for k in (0..n / WIDE).map(|k| k * WIDE) {
        lanes = wide.add(lanes, level(take(raw, p + k)));
    }
    let mut l = wide.store(lanes);
    if n % WIDE > 0 {
        let rest = wide.store(level(&some::<_, false>(raw, p + n / WIDE * WIDE, n % WIDE)));
        for k in 0..n % WIDE {
            l[k] += rest[k];
        }
    }
    let (even, odd) = (n.div_ceil(PARITIES), n / PARITIES);
    [
        ((l[0] + l[4]) + (l[2] + l[6])) / even.max(1) as f32,
        ((l[1] + l[5]) + (l[3] + l[7])) / odd.max(1) as f32,
    ]
}
