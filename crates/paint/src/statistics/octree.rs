//! An octree in Lab over the colours of a slice, split until it has n leaves, and the boxes of these.
//!
//! Colours are sorted along a Morton curve, so a node of the tree is a run of them; sums along that order give the spread of any
//! run at once. The leaf that spreads most (mass times variance) is split next. Leaves too rare for a step of the distribution function join the leaf
//! they are nearest to (Ward's criterion).

use super::STEPS;

/// How the box of a leaf is laid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cuboids {
    /// Around the mean, half as wide as √3 standard deviations on each axis, then all boxes of a slice together moved and stretched (by rounding's worth): mean
    /// and standard deviation of the slice are kept.
    #[default]
    Moments,
    /// From the smallest to the largest value on each axis, as in the paper.
    Tight,
}

/// A box with its number of steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leaf {
    pub low: [f32; 3],
    pub high: [f32; 3],
    pub steps: u16,
}

/// Levels of the tree, 2^10 cells along each axis.
const LEVELS: u32 = 10;

/// Values of a digit of the sort.
const DIGITS: usize = 1 << LEVELS;

/// Places of the order from one kept sum to the next.
const STRIDE: usize = 16;

/// Scratch of one thread.
#[derive(Debug, Default)]
pub(super) struct Octree {
    pub lab: [Vec<f32>; 3],
    keys: Vec<u64>,
    spare: Vec<u64>,
    /// Colours along the order.
    ordered: Vec<[f32; 3]>,
    /// Sums of L, a, b and their squares before every [`STRIDE`]th place of the order, and over all.
    sums: Vec<[f64; 6]>,
    total: [f64; 6],
    counts: Vec<u32>,
}

/// A run of the order, or a union of runs.
#[derive(Clone, Copy, Debug)]
struct Node {
    start: usize,
    end: usize,
    level: u32,
    count: f64,
    sum: [f64; 6],
    low: [f32; 3],
    high: [f32; 3],
    spread: f64,
}

impl Octree {
    /// Boxes of the colours in `lab`, at most `clusters`, by rising lightness.
    pub fn leaves(&mut self, clusters: usize, cuboids: Cuboids) -> Vec<Leaf> {
        let n = self.lab[0].len();
        self.sort();
        self.sum_up(n);
        let mut nodes = vec![self.node(0, n, 0)];
        self.split(&mut nodes, clusters, 0.0);
        join_rare(&mut nodes, n as f64);
        // room that joining made: split on where no rare leaf would come out
        self.split(&mut nodes, clusters, 0.5 * n as f64 / STEPS as f64);
        if cuboids == Cuboids::Tight {
            for node in &mut nodes {
                (node.low, node.high) = self.bounds(node);
            }
        }
        nodes.sort_by(|p, q| (p.sum[0] * q.count).total_cmp(&(q.sum[0] * p.count)));
        let steps = steps(&nodes, n as f64);
        let mut leaves: Vec<Leaf> =
            nodes.iter().zip(&steps).map(|(node, &steps)| node.leaf(cuboids, steps)).collect();
        if cuboids == Cuboids::Moments {
            keep_moments(&mut leaves, self.total, n as f64);
        }
        leaves
    }

    fn sort(&mut self) {
        let n = self.lab[0].len();
        let mut low = [f32::INFINITY; 3];
        let mut side = 0.0_f32;
        for (axis, values) in self.lab.iter().enumerate() {
            let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
            for &v in values {
                least = if v < least { v } else { least };
                most = if v > most { v } else { most };
            }
            low[axis] = least;
            side = side.max(most - least);
        }
        let scale = if side > 0.0 { (1 << LEVELS) as f32 / side } else { 0.0 };
        let top = (1 << LEVELS) as f32 - 1.0;
        let [l, a, b] = [&self.lab[0][..n], &self.lab[1][..n], &self.lab[2][..n]];
        self.keys.resize(n, 0);
        self.spare.resize(n, 0);
        self.counts.clear();
        self.counts.resize(3 * DIGITS, 0);
        let (first, rest) = self.counts.split_at_mut(DIGITS);
        let (second, third) = rest.split_at_mut(DIGITS);
        // differences are not negative and below 2^10: the cast through i32 is one instruction where u32 takes several
        let cell = |v: f32, low: f32| spread_bits(((v - low) * scale).min(top) as i32 as u32);
        for (k, (((key, l), a), b)) in self.keys.iter_mut().zip(l).zip(a).zip(b).enumerate() {
            let code = cell(*l, low[0]) << 2 | cell(*a, low[1]) << 1 | cell(*b, low[2]);
            *key = u64::from(code) << 32 | k as u64;
            first[digit(*key, 0)] += 1;
            second[digit(*key, 1)] += 1;
            third[digit(*key, 2)] += 1;
        }
        for (pass, counts) in self.counts.chunks_exact_mut(DIGITS).enumerate() {
            let mut start = 0;
            for c in counts.iter_mut() {
                (*c, start) = (start, start + *c);
            }
            let spare = &mut self.spare[..];
            for k in &self.keys {
                let at = &mut counts[digit(*k, pass as u32)];
                spare[*at as usize] = *k;
                *at += 1;
            }
            std::mem::swap(&mut self.keys, &mut self.spare);
        }
    }

    fn sum_up(&mut self, n: usize) {
        let [l, a, b] = [&self.lab[0][..n], &self.lab[1][..n], &self.lab[2][..n]];
        self.ordered.clear();
        self.ordered.extend(self.keys.iter().map(|k| {
            let k = *k as u32 as usize;
            [l[k], a[k], b[k]]
        }));
        self.sums.clear();
        let mut sum = [0.0; 6];
        for chunk in self.ordered.chunks(STRIDE) {
            self.sums.push(sum);
            add(&mut sum, chunk);
        }
        self.sums.push(sum);
        self.total = sum;
    }

    /// Sums over the order before a place.
    fn before(&self, place: usize) -> [f64; 6] {
        let block = place / STRIDE;
        let mut sum = self.sums[block];
        add(&mut sum, &self.ordered[block * STRIDE..place]);
        sum
    }

    fn node(&self, start: usize, end: usize, level: u32) -> Node {
        let (before, mut sum) = (self.before(start), self.before(end));
        for c in 0..6 {
            sum[c] -= before[c];
        }
        let count = (end - start) as f64;
        Node { start, end, level, count, sum, low: [0.0; 3], high: [0.0; 3], spread: spread(&sum, count) }
    }

    /// Splits the leaf that spreads most, as long as there is room for its children and none of them is rarer than `rare`.
    fn split(&self, nodes: &mut Vec<Node>, clusters: usize, rare: f64) {
        let mut closed = vec![false; nodes.len()];
        loop {
            let open = (0..nodes.len())
                .filter(|&k| !closed[k] && nodes[k].spread > 1e-9 && nodes[k].end > nodes[k].start);
            let Some(at) = open.max_by(|&p, &q| nodes[p].spread.total_cmp(&nodes[q].spread)) else { return };
            let children = self.children(&nodes[at]);
            let fits = nodes.len() - 1 + children.len() <= clusters;
            if children.len() < 2 || !fits || children.iter().any(|c| c.count < rare) {
                closed[at] = true;
                continue;
            }
            nodes[at] = children[0];
            for child in &children[1..] {
                nodes.push(*child);
                closed.push(false);
            }
        }
    }

    /// Children that hold colours, of the first level below that has more than one.
    fn children(&self, node: &Node) -> Vec<Node> {
        let mut children = Vec::with_capacity(8);
        let run = &self.keys[node.start..node.end];
        for level in node.level..LEVELS {
            let shift = 32 + 3 * (LEVELS - 1 - level);
            let octant = |k: u64| (k >> shift) & 7;
            if octant(run[0]) == octant(run[run.len() - 1]) {
                continue;
            }
            let mut start = 0;
            while start < run.len() {
                let here = octant(run[start]);
                let length = run[start..].partition_point(|k| octant(*k) <= here);
                children.push(self.node(node.start + start, node.start + start + length, level + 1));
                start += length;
            }
            break;
        }
        children
    }

    /// Smallest and largest value of a run on each axis.
    fn bounds(&self, node: &Node) -> ([f32; 3], [f32; 3]) {
        let (mut low, mut high) = if node.low[0] < node.high[0] {
            (node.low, node.high)
        } else {
            ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3])
        };
        for colour in &self.ordered[node.start..node.end] {
            for c in 0..3 {
                let v = colour[c];
                low[c] = if v < low[c] { v } else { low[c] };
                high[c] = if v > high[c] { v } else { high[c] };
            }
        }
        (low, high)
    }
}

impl Node {
    fn mean(&self) -> [f64; 3] {
        [0, 1, 2].map(|c: usize| self.sum[c] / self.count)
    }

    fn leaf(&self, cuboids: Cuboids, steps: u16) -> Leaf {
        match cuboids {
            Cuboids::Tight => Leaf { low: self.low, high: self.high, steps },
            Cuboids::Moments => {
                let mean = self.mean();
                let half = [0, 1, 2].map(|c: usize| {
                    // of a uniform distribution: variance = (half width)²/3
                    (3.0 * (self.sum[c + 3] / self.count - mean[c] * mean[c])).max(0.0).sqrt()
                });
                Leaf {
                    low: [0, 1, 2].map(|c: usize| (mean[c] - half[c]) as f32),
                    high: [0, 1, 2].map(|c: usize| (mean[c] + half[c]) as f32),
                    steps,
                }
            }
        }
    }
}

#[inline(always)]
fn digit(key: u64, pass: u32) -> usize {
    (key >> (32 + pass * LEVELS)) as usize & (DIGITS - 1)
}

fn add(sum: &mut [f64; 6], colours: &[[f32; 3]]) {
    for colour in colours {
        for c in 0..3 {
            let v = f64::from(colour[c]);
            sum[c] += v;
            sum[c + 3] += v * v;
        }
    }
}

/// Ten bits with two zeros between each two.
#[inline(always)]
fn spread_bits(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

/// Sum of squared distances from the mean.
fn spread(sum: &[f64; 6], count: f64) -> f64 {
    (0..3).map(|c| sum[c + 3] - sum[c] * sum[c] / count).sum::<f64>().max(0.0)
}

/// Joins leaves of less than half a step to those that spread least more with them.
fn join_rare(nodes: &mut Vec<Node>, total: f64) {
    let rare = 0.5 * total / STEPS as f64;
    while nodes.len() > 1 {
        let Some(at) = (0..nodes.len())
            .filter(|&k| nodes[k].count < rare)
            .min_by(|&p, &q| nodes[p].count.total_cmp(&nodes[q].count))
        else {
            return;
        };
        let node = nodes.swap_remove(at);
        let mean = node.mean();
        let cost = |other: &Node| {
            let d2: f64 = other.mean().iter().zip(mean).map(|(p, q)| (p - q) * (p - q)).sum();
            d2 * other.count * node.count / (other.count + node.count)
        };
        let Some(to) = (0..nodes.len()).min_by(|&p, &q| cost(&nodes[p]).total_cmp(&cost(&nodes[q]))) else {
            return;
        };
        let other = &mut nodes[to];
        other.count += node.count;
        for c in 0..6 {
            other.sum[c] += node.sum[c];
        }
        // no run any more: kept as it is, not split again
        other.spread = 0.0;
    }
}

/// Whole steps for each leaf, one at least, by largest remainder.
fn steps(nodes: &[Node], total: f64) -> Vec<u16> {
    let wanted: Vec<f64> = nodes.iter().map(|n| n.count / total * STEPS as f64).collect();
    let mut steps: Vec<u16> = wanted.iter().map(|w| (w.floor() as u16).max(1)).collect();
    let mut given: usize = steps.iter().map(|s| usize::from(*s)).sum();
    while given != STEPS {
        let lack = |k: usize| wanted[k] - f64::from(steps[k]);
        if given < STEPS {
            let Some(k) = (0..nodes.len()).max_by(|&p, &q| lack(p).total_cmp(&lack(q))) else { break };
            steps[k] += 1;
            given += 1;
        } else {
            let with_more = (0..nodes.len()).filter(|&k| steps[k] > 1);
            let Some(k) = with_more.min_by(|&p, &q| lack(p).total_cmp(&lack(q))) else { break };
            steps[k] -= 1;
            given -= 1;
        }
    }
    steps
}

/// Moves and stretches all boxes so that mean and variance of each axis are those of the texels again.
fn keep_moments(leaves: &mut [Leaf], total: [f64; 6], count: f64) {
    for c in 0..3 {
        let mean = total[c] / count;
        let variance = (total[c + 3] / count - mean * mean).max(0.0);
        let [found, spread] = moments(leaves, c);
        let stretch = if spread > 0.0 { (variance / spread).sqrt() } else { 1.0 };
        for leaf in leaves.iter_mut() {
            for corner in [&mut leaf.low, &mut leaf.high] {
                corner[c] = (mean + stretch * (f64::from(corner[c]) - found)) as f32;
            }
        }
    }
}

/// Mean and variance of one axis over boxes, colours uniform inside.
fn moments(leaves: &[Leaf], c: usize) -> [f64; 2] {
    let (mut mean, mut square) = (0.0, 0.0);
    for leaf in leaves {
        let p = f64::from(leaf.steps) / STEPS as f64;
        let (low, high) = (f64::from(leaf.low[c]), f64::from(leaf.high[c]));
        let centre = 0.5 * (low + high);
        mean += p * centre;
        square += p * (centre * centre + (high - low) * (high - low) / 12.0);
    }
    [mean, (square - mean * mean).max(0.0)]
}
