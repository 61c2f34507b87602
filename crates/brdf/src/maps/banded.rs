//! Symmetric positive definite band matrices: Cholesky's factorisation and the solution for several right-hand sides.

/// Lower band of a symmetric matrix, row by row: entry (r, c) with r − reach ≤ c ≤ r stands at `r·(reach + 1) + reach − (r − c)`.
pub(super) struct Banded {
    size: usize,
    reach: usize,
    entries: Vec<f64>,
}

impl Banded {
    /// Zeros.
    pub(super) fn new(size: usize, reach: usize) -> Self {
        Self { size, reach, entries: vec![0.0; size * (reach + 1)] }
    }

    /// Adds to the entries (r, c) and (c, r); they must lie within the band.
    pub(super) fn add(&mut self, r: usize, c: usize, x: f64) {
        let (r, c) = (r.max(c), r.min(c));
        debug_assert!(r - c <= self.reach && r < self.size);
        self.entries[r * (self.reach + 1) + self.reach - (r - c)] += x;
    }

    /// Solves for each right-hand side in place; the matrix becomes its factor. False where it is not positive definite.
    pub(super) fn solve(&mut self, right: &mut [Vec<f64>]) -> bool {
        let (n, b, w) = (self.size, self.reach, self.reach + 1);
        for r in 0..n {
            let first = r.saturating_sub(b);
            for c in first..=r {
                let shared = first.max(c.saturating_sub(b));
                let row = &self.entries[r * w + b + shared - r..r * w + b + c - r];
                let other = &self.entries[c * w + b + shared - c..c * w + b];
                let dot: f64 = dot(row, other);
                let at = r * w + b + c - r;
                let rest = self.entries[at] - dot;
                self.entries[at] = if c < r {
                    rest / self.entries[c * w + b]
                } else if rest > 0.0 {
                    rest.sqrt()
                } else {
                    return false;
                };
            }
        }
        for x in right {
            for r in 0..n {
                let first = r.saturating_sub(b);
                let row = &self.entries[r * w + b + first - r..r * w + b];
                x[r] = (x[r] - dot(row, &x[first..r])) / self.entries[r * w + b];
            }
            for r in (0..n).rev() {
                x[r] /= self.entries[r * w + b];
                let (first, at) = (r.saturating_sub(b), x[r]);
                let row = &self.entries[r * w + b + first - r..r * w + b];
                for (y, l) in x[first..r].iter_mut().zip(row) {
                    *y -= l * at;
                }
            }
        }
        true
    }
}

/// Four sums, so that the additions need not wait for each other.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (mut sums, n) = ([0.0; 4], a.len() / 4 * 4);
    for (x, y) in a[..n].chunks_exact(4).zip(b[..n].chunks_exact(4)) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    let tail: f64 = a[n..].iter().zip(&b[n..]).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + tail
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_solution_is_found() {
        let (n, reach) = (40, 7);
        let entry = |r: usize, c: usize| {
            if r == c { 9.0 } else { 1.0 / (1.0 + (r * c % 5) as f64 + r.abs_diff(c) as f64) }
        };
        let mut m = Banded::new(n, reach);
        let want: Vec<f64> = (0..n).map(|i| (i as f64 * 0.7).sin()).collect();
        for r in 0..n {
            for c in r.saturating_sub(reach)..=r {
                m.add(r, c, entry(r, c));
            }
        }
        let product = |r: usize| {
            want.iter()
                .enumerate()
                .filter(|(c, _)| r.abs_diff(*c) <= reach)
                .map(|(c, x)| entry(r, c) * x)
                .sum()
        };
        let right: Vec<f64> = (0..n).map(product).collect();
        let mut x = [right];
        assert!(m.solve(&mut x));
        assert!(x[0].iter().zip(&want).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        let mut m = Banded::new(2, 1);
        m.add(0, 0, 1.0);
        m.add(1, 0, 2.0);
        m.add(1, 1, 1.0);
        assert!(!m.solve(&mut [vec![1.0, 1.0]]));
    }
}
