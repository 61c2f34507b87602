//! The merge of one sensor row, thirty-two pixels a time, in a form that compilers turn into vector instructions.
//!
//! A block's exposures are classed first ([`super::classes`]): clear of saturation in every pixel, saturated in every pixel, or mixed. Where no exposure is mixed
//! the weights are the same for all pixels of a colour in the block, so a pixel costs one multiplication and one addition an exposure, and the
//! parts of its variance are straight lines in its rate and its dark current ([`super::plan`]). Only in mixed blocks the sums depend on the pixel.
//!
//! The rate that the weights expect is the mean of the block's pixels of one colour in the longest exposure that is clear. Any weights that do
//! not depend on a pixel's own noise leave its rate without bias; near the best ones the variance is flat, so a mean over a few degrees serves,
//! and it is surer than the pixel's own counts.

use super::classes::Class;
use super::plan::{Lines, Sums};
use super::shots::{Ramp, Shots};
use super::wide::{WIDE, Wide};

/// Pixels of a block.
pub(crate) const BLOCK: usize = 32;
/// Colours that alternate along a row.
pub(super) const PARITIES: usize = 2;
/// Vectors of a block.
const GROUPS: usize = BLOCK / WIDE;

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
    /// Mixed exposures of a block: 1 in the columns where they are.
    mixed: Vec<(usize, [f32; PARITIES])>,
}

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
            mixed: Vec::new(),
        }
    }

    /// Merges the `blocks` of row `y`.
    #[inline(always)]
    pub(crate) fn merge<W: Wide>(&mut self, wide: W, shots: &Shots<'_>, y: usize, blocks: &[u32]) {
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
        blocks: &[u32],
        level: &impl Fn(&[u16; WIDE]) -> W::F,
    ) {
        for &block in blocks {
            let x = block as usize * BLOCK;
            let clear = self.classify(wide, shots, y, x);
            // without a clear one, of which nothing comes, the shortest stands
            let [even, odd] = clear.map(|n| n.saturating_sub(1));
            let mut means = shots.block_means(wide, y, x, shots.list[even].raw, level);
            if odd != even {
                means[1] = shots.block_means(wide, y, x, shots.list[odd].raw, level)[1];
            }
            let rates = [shots.list[even].expected(means[0]), shots.list[odd].expected(means[1])];
            let plans = [0, 1].map(|k| shots.plans.find(rates[k], clear[k]));
            // rows below will read the same, with their neighbours two rows further down; a row's stretch is too short for a machine to find that out by itself
            let from = plans.map(|k| shots.plans.lines(k).from);
            for shot in &shots.list[from[0].min(from[1]) as usize..] {
                wide.ahead(shot.raw, (y + 3) * shots.width + x);
            }
            let below = (y + 1) * shots.width + x;
            wide.ahead(shots.dark_mean, below);
            wide.ahead(shots.dark_current, below);
            if let [(j, mixed)] = self.mixed[..]
                && (0..PARITIES).all(|k| mixed[k] == 0.0 || clear[k] == j)
                && x + BLOCK <= shots.width
            {
                // the usual case: with the one mixed exposure a pixel follows one plan, without it another
                let with = [0, 1].map(|k| match mixed[k] > 0.0 {
                    true => shots.plans.find(rates[k], j + 1),
                    false => plans[k],
                });
                self.either(wide, shots, y, (x, j), [with, plans], level);
                continue;
            }
            match (self.mixed.is_empty(), x + BLOCK <= shots.width) {
                (true, true) => self.clear::<W, true>(wide, shots, y, x, plans, level),
                (true, false) => self.clear::<W, false>(wide, shots, y, x, plans, level),
                (false, true) => self.mixed::<W, true>(wide, shots, y, x, plans, level),
                (false, false) => self.mixed::<W, false>(wide, shots, y, x, plans, level),
            }
        }
    }

    /// How many exposures are clear in the block at (x, y); notes those that are mixed.
    #[inline(always)]
    fn classify<W: Wide>(&mut self, wide: W, shots: &Shots<'_>, y: usize, x: usize) -> [usize; PARITIES] {
        self.mixed.clear();
        let mut clear = [0; PARITIES];
        for (j, shot) in shots.list.iter().enumerate().rev() {
            let class = shots.class(wide, y, x, shot.raw);
            if class == [Class::Clear; PARITIES] {
                return clear.map(|n| if n > 0 { n } else { j + 1 });
            }
            // an exposure is clear where a longer one is
            let mixed = [0, 1].map(|k| f32::from(clear[k] == 0 && class[k] == Class::Mixed));
            if mixed != [0.0; PARITIES] {
                self.mixed.push((j, mixed));
            }
            for k in 0..PARITIES {
                if clear[k] == 0 && class[k] == Class::Clear {
                    clear[k] = j + 1;
                }
            }
            if clear[0] > 0 && clear[1] > 0 {
                break;
            }
        }
        clear
    }

    /// The block from pixel `start` on, in which no exposure is mixed; `WHOLE` where the row does not end within it.
    #[inline(always)]
    fn clear<W: Wide, const WHOLE: bool>(
        &mut self,
        wide: W,
        shots: &Shots<'_>,
        y: usize,
        start: usize,
        plans: [usize; PARITIES],
        level: &impl Fn(&[u16; WIDE]) -> W::F,
    ) {
        let w = wide;
        let lines = plans.map(|plan| shots.plans.lines(plan));
        let line = |of: fn(&Lines) -> f32| w.pattern(lines.map(of));
        self.lost[start / BLOCK] = lines[0].den <= 0.0 || lines[1].den <= 0.0;
        let step = shots.dark_step.map(|s| w.splat(s));
        let (sum, sum_t) = (w.mul(line(|l| l.sum), step[0]), w.mul(line(|l| l.sum_t), step[1]));
        let p = y * shots.width + start;
        let n = if WHOLE { BLOCK } else { shots.width - start };
        let (mut mean_room, mut current_room) = ([0; BLOCK], [0; BLOCK]);
        let means = there::<_, BLOCK, WHOLE>(shots.dark_mean, p, n, &mut mean_room);
        let currents = there::<_, BLOCK, WHOLE>(shots.dark_current, p, n, &mut current_room);
        let (means, currents) = (means.as_chunks::<WIDE>().0, currents.as_chunks::<WIDE>().0);
        let mut rates = [line(|l| l.offset); GROUPS];
        for ((rate, mean), current) in rates.iter_mut().zip(means).zip(currents) {
            let dark = w.add(w.mul(sum, w.steps(mean)), w.mul(sum_t, w.steps(current)));
            *rate = w.sub(*rate, dark);
        }
        let taken = lines[0].from.min(lines[1].from) as usize..lines[0].end.max(lines[1].end) as usize;
        let [even, odd] = plans.map(|plan| &shots.plans.levels(plan)[taken.clone()]);
        for ((shot, even), odd) in shots.list[taken].iter().zip(even).zip(odd) {
            let weight = w.pattern([*even, *odd]);
            let mut room = [0; BLOCK];
            let raw = there::<_, BLOCK, WHOLE>(shot.raw, p, n, &mut room);
            for (rate, raw) in rates.iter_mut().zip(raw.as_chunks::<WIDE>().0) {
                *rate = w.add(*rate, w.mul(weight, level(raw)));
            }
        }
        let (den, exposure) = (line(|l| l.den), line(|l| l.exposure));
        let (by_rate, by_current) = (line(|l| l.by_rate), w.mul(line(|l| l.by_current), step[1]));
        let (read, dark) = (line(|l| l.read), line(|l| l.dark));
        for (k, (rate, current)) in rates.into_iter().zip(currents).enumerate() {
            let current = w.positive(w.steps(current));
            let shot = w.add(w.mul(by_rate, w.positive(rate)), w.mul(by_current, current));
            let rate = w.where_above_zero(den, rate, w.splat(f32::INFINITY));
            self.put(w, start + k * WIDE, [rate, shot, read, dark, exposure]);
        }
    }

    /// The block from pixel `start` on, in which exposure `j` alone is mixed: each pixel follows the first of the plans where that exposure serves it, else
    /// the second.
    #[inline(always)]
    fn either<W: Wide>(
        &mut self,
        wide: W,
        shots: &Shots<'_>,
        y: usize,
        (start, j): (usize, usize),
        plans: [[usize; PARITIES]; 2],
        level: &impl Fn(&[u16; WIDE]) -> W::F,
    ) {
        let (w, p) = (wide, y * shots.width + start);
        let lines = plans.map(|plans| plans.map(|plan| shots.plans.lines(plan)));
        let raw = shots.list[j].raw;
        let mut serves = [w.splat(0.0); GROUPS];
        for (k, serves) in serves.iter_mut().enumerate() {
            *serves = shots.usable(w, raw, start + k * WIDE, y);
        }
        let both = |of: fn(&Lines) -> f32| lines.map(|lines| w.pattern(lines.map(of)));
        let pick = |serves: W::F, [with, without]: [W::F; 2]| w.where_above_zero(serves, with, without);
        let [mean_step, current_step] = shots.dark_step.map(|s| w.splat(s));
        let in_steps = |of: [W::F; 2], step: W::F| of.map(|v| w.mul(v, step));
        let offset = both(|l| l.offset);
        let (sum, sum_t) = (in_steps(both(|l| l.sum), mean_step), in_steps(both(|l| l.sum_t), current_step));
        let means = take::<_, BLOCK>(shots.dark_mean, p).as_chunks::<WIDE>().0;
        let currents = take::<_, BLOCK>(shots.dark_current, p).as_chunks::<WIDE>().0;
        let mut rates = [w.splat(0.0); GROUPS];
        for (((rate, mean), current), serves) in rates.iter_mut().zip(means).zip(currents).zip(serves) {
            let of_mean = w.mul(pick(serves, sum), w.steps(mean));
            let dark = w.add(of_mean, w.mul(pick(serves, sum_t), w.steps(current)));
            *rate = w.sub(pick(serves, offset), dark);
        }
        let all = || lines.iter().flatten();
        let from = all().map(|l| l.from).min().unwrap_or(0) as usize;
        let end = all().map(|l| l.end).max().unwrap_or(0) as usize;
        let levels = plans.map(|plans| plans.map(|plan| &shots.plans.levels(plan)[..end]));
        for (i, shot) in shots.list[..end].iter().enumerate().skip(from) {
            let weights = levels.map(|levels| w.pattern(levels.map(|levels| levels[i])));
            let raw = take::<_, BLOCK>(shot.raw, p).as_chunks::<WIDE>().0;
            for ((rate, raw), serves) in rates.iter_mut().zip(raw).zip(serves) {
                *rate = w.add(*rate, w.mul(pick(serves, weights), level(raw)));
            }
        }
        let (den, exposure) = (both(|l| l.den), both(|l| l.exposure));
        let (by_rate, by_current) = (both(|l| l.by_rate), in_steps(both(|l| l.by_current), current_step));
        let (read, dark) = (both(|l| l.read), both(|l| l.dark));
        let mut lost = false;
        for (k, ((rate, current), serves)) in rates.into_iter().zip(currents).zip(serves).enumerate() {
            let current = w.positive(w.steps(current));
            let of_rate = w.mul(pick(serves, by_rate), w.positive(rate));
            let shot = w.add(of_rate, w.mul(pick(serves, by_current), current));
            let den = pick(serves, den);
            lost |= !w.all_above_zero(den);
            let rate = w.where_above_zero(den, rate, w.splat(f32::INFINITY));
            let others = [read, dark, exposure].map(|of| pick(serves, of));
            self.put(w, start + k * WIDE, [rate, shot, others[0], others[1], others[2]]);
        }
        self.lost[start / BLOCK] = lost;
    }

    #[inline(always)]
    fn put<W: Wide>(&mut self, w: W, x: usize, [rate, shot, read, dark, exposure]: [W::F; 5]) {
        *place(&mut self.rate, x) = w.store(rate);
        *place(&mut self.shot, x) = w.store(shot);
        *place(&mut self.read, x) = w.store(read);
        *place(&mut self.dark, x) = w.store(dark);
        *place(&mut self.exposure, x) = w.store(exposure);
    }

    /// The block from pixel `start` on, in which some exposure is saturated in some pixels: to the sums over the clear exposures each pixel adds those
    /// mixed ones that serve it.
    #[inline(always)]
    fn mixed<W: Wide, const WHOLE: bool>(
        &mut self,
        wide: W,
        shots: &Shots<'_>,
        y: usize,
        start: usize,
        plans: [usize; PARITIES],
        level: &impl Fn(&[u16; WIDE]) -> W::F,
    ) {
        let w = wide;
        let (lines, sums) =
            (plans.map(|plan| shots.plans.lines(plan)), plans.map(|plan| shots.plans.sums(plan)));
        let line = |of: fn(&Lines) -> f32| w.pattern(lines.map(of));
        let of_sums = |of: fn(&Sums) -> f32| w.pattern(sums.map(of));
        let (slope, offset) = shots.ramp.line();
        let (slope, offset) = (w.splat(slope), w.splat(offset));
        let (zero, one) = (w.splat(0.0), w.splat(1.0));
        let [mean_step, current_step] = shots.dark_step.map(|s| w.splat(s));
        let (den_clear, exposure_clear) = (line(|l| l.den), line(|l| l.exposure));
        let (by_rate_clear, by_current_clear) = (of_sums(|s| s.by_rate), of_sums(|s| s.by_current));
        let (squares_clear, rate_expected) = (of_sums(|s| s.squares), of_sums(|s| s.rate));
        let (sum_clear, sum_t_clear) = (of_sums(|s| s.sum), of_sums(|s| s.sum_t));
        let taken = lines[0].from.min(lines[1].from) as usize..lines[0].end.max(lines[1].end) as usize;
        let [even, odd] = plans.map(|plan| &shots.plans.weights(plan)[taken.clone()]);
        self.lost[start / BLOCK] = false;
        let p = y * shots.width + start;
        let n = if WHOLE { BLOCK } else { shots.width - start };
        let mut levels = [zero; GROUPS];
        for ((shot, even), odd) in shots.list[taken].iter().zip(even).zip(odd) {
            let weight = w.pattern([*even, *odd]);
            let mut room = [0; BLOCK];
            let raw = there::<_, BLOCK, WHOLE>(shot.raw, p, n, &mut room);
            for (levels, raw) in levels.iter_mut().zip(raw.as_chunks::<WIDE>().0) {
                *levels = w.add(*levels, w.mul(weight, level(raw)));
            }
        }
        for (k, mut levels) in levels.into_iter().enumerate() {
            let x = start + k * WIDE;
            if !WHOLE && x >= shots.width {
                break;
            }
            let p = y * shots.width + x;
            let n = if WHOLE { WIDE } else { WIDE.min(shots.width - x) };
            let (mut den, mut sum, mut sum_t) = (den_clear, sum_clear, sum_t_clear);
            let (mut by_rate, mut by_current) = (by_rate_clear, by_current_clear);
            let (mut squares, mut exposure) = (squares_clear, exposure_clear);
            for &(j, mixed) in &self.mixed {
                let shot = &shots.list[j];
                let serves = w.mul(shots.usable(w, shot.raw, x, y), w.pattern(mixed));
                let weight = w.div(serves, w.add(rate_expected, w.splat(shot.noise_rate)));
                let square = w.mul(weight, weight);
                let t = w.splat(shot.x);
                levels = w.add(levels, w.mul(weight, level(&some::<_, WIDE, WHOLE>(shot.raw, p, n))));
                den = w.add(den, w.mul(weight, t));
                sum = w.add(sum, weight);
                sum_t = w.add(sum_t, w.mul(weight, w.splat(shot.since_mean_s)));
                exposure = w.add(exposure, w.mul(serves, t));
                by_rate = w.add(by_rate, w.mul(square, t));
                by_current = w.add(by_current, w.mul(square, w.splat(shot.dark_s)));
                squares = w.add(squares, square);
            }
            let mean = w.mul(mean_step, w.steps(&some::<_, WIDE, WHOLE>(shots.dark_mean, p, n)));
            let current = w.mul(current_step, w.steps(&some::<_, WIDE, WHOLE>(shots.dark_current, p, n)));
            let per = w.where_above_zero(den, w.div(one, den), zero);
            let square = w.mul(per, per);
            let electrons = w.add(w.mul(slope, levels), w.mul(sum, w.sub(offset, mean)));
            let known = w.mul(w.sub(electrons, w.mul(sum_t, current)), per);
            let dark = w.add(
                w.mul(w.mul(sum, sum), w.splat(shots.dark_mean_e2)),
                w.mul(w.mul(sum_t, sum_t), w.splat(shots.dark_current_e2)),
            );
            let shot = w.add(w.mul(by_rate, w.positive(known)), w.mul(by_current, w.positive(current)));
            let rate = w.where_above_zero(den, known, w.splat(f32::INFINITY));
            self.lost[x / BLOCK] |= !w.all_above_zero(den);
            let read = w.mul(squares, w.splat(shots.read_e2));
            self.put(w, x, [rate, w.mul(shot, square), w.mul(read, square), w.mul(dark, square), exposure]);
        }
    }
}

/// N entries from `at`; callers hold that there are so many.
#[inline(always)]
pub(super) fn take<T, const N: usize>(from: &[T], at: usize) -> &[T; N] {
    from[at..].first_chunk().expect("a whole block within the frame")
}

/// N entries from `at`, of which the first `n` are there (all of them where `WHOLE`); what is not is put together in `room`.
#[inline(always)]
fn there<'a, T: Copy + Default, const N: usize, const WHOLE: bool>(
    from: &'a [T],
    at: usize,
    n: usize,
    room: &'a mut [T; N],
) -> &'a [T; N] {
    if WHOLE {
        return take(from, at);
    }
    *room = std::array::from_fn(|k| if k < n { from[at + k] } else { T::default() });
    room
}

/// The same by value.
#[inline(always)]
pub(super) fn some<T: Copy + Default, const N: usize, const WHOLE: bool>(
    from: &[T],
    at: usize,
    n: usize,
) -> [T; N] {
    *there::<T, N, WHOLE>(from, at, n, &mut [T::default(); N])
}

/// Room for eight entries from `at`.
#[inline(always)]
fn place(from: &mut [f32], at: usize) -> &mut [f32; WIDE] {
    from[at..].first_chunk_mut().expect("room for a row and more")
}
