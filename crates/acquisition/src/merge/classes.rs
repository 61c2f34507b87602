//! How an exposure serves a block: clear of saturation in every pixel, saturated in every pixel, or mixed; and what it says of the light there.

use super::lanes::{BLOCK, PARITIES, some, take};
use super::shots::Shots;
use super::wide::{WIDE, Wide};

/// How an exposure serves the pixels of one colour in a block.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Class {
    #[default]
    Clear,
    Mixed,
    Saturated,
}

impl Shots<'_> {
    /// How an exposure serves the block at (x, y), its even and its odd columns.
    #[inline(always)]
    pub(super) fn class<W: Wide>(&self, wide: W, y: usize, x: usize, raw: &[u16]) -> [Class; PARITIES] {
        let (w, h) = (self.width, self.height);
        let row = y * w;
        if x + BLOCK > w {
            return self.class_by_neighbours(y, x, raw);
        }
        let own = Extremes::of(wide, take(raw, row + x));
        if wide.all_below(own.high, self.surely_below) {
            return [Class::Clear; PARITIES];
        }
        if wide.all_from(own.low, self.clipped) {
            return [Class::Saturated; PARITIES];
        }
        if x < 2 || x + BLOCK + 2 > w || y < 2 || y + 2 >= h {
            return self.class_by_neighbours(y, x, raw);
        }
        let mut around = own;
        for v in [row - 2 * w, row, row + 2 * w] {
            around = around.with(wide, take(raw, v + x - 2)).with(wide, take(raw, v + x + 2));
        }
        if wide.all_below(around.high, self.saturated_from.min(self.clipped)) {
            return [Class::Clear; PARITIES];
        }
        if wide.all_from(around.low, self.saturated_from) {
            return [Class::Saturated; PARITIES];
        }
        self.judge(own.by_parity(wide), around.by_parity(wide))
    }

    /// The same at the edges of the sensor.
    #[cold]
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
        [0, 1].map(
            #[inline(always)]
            |k: usize| {
                if own_high[k] < self.surely_below
                    || (own_high[k] < self.clipped && high[k] < self.saturated_from)
                {
                    Class::Clear
                } else if low[k] >= self.saturated_from || own_low[k] >= self.clipped {
                    Class::Saturated
                } else {
                    Class::Mixed
                }
            },
        )
    }

    /// Mean level of the block's pixels of either parity.
    #[inline(always)]
    pub(super) fn block_means<W: Wide>(
        &self,
        wide: W,
        y: usize,
        x: usize,
        raw: &[u16],
        level: &impl Fn(&[u16; WIDE]) -> W::F,
    ) -> [f32; PARITIES] {
        let (p, n) = (y * self.width + x, BLOCK.min(self.width - x));
        let mut lanes = wide.splat(0.0);
        if n == BLOCK {
            let (groups, _) = take::<u16, BLOCK>(raw, p).as_chunks::<WIDE>();
            for group in groups {
                lanes = wide.add(lanes, level(group));
            }
        } else {
            for k in (0..n / WIDE).map(|k| k * WIDE) {
                lanes = wide.add(lanes, level(take(raw, p + k)));
            }
        }
        let mut l = wide.store(lanes);
        if n % WIDE > 0 {
            let rest = wide.store(level(&some::<_, WIDE, false>(raw, p + n / WIDE * WIDE, n % WIDE)));
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
        let (a, b) = (w.load_counts(take(values, 0)), w.load_counts(take(values, 2 * WIDE)));
        Self { low: w.least(a, b), high: w.most(a, b) }
    }

    #[inline(always)]
    fn with(self, w: W, values: &[u16; BLOCK]) -> Self {
        let other = Self::of(w, values);
        Self { low: w.least(self.low, other.low), high: w.most(self.high, other.high) }
    }

    #[inline(always)]
    fn by_parity(&self, w: W) -> ([u16; PARITIES], [u16; PARITIES]) {
        (w.least_by_parity(self.low), w.most_by_parity(self.high))
    }
}
