//! Least squares with no coefficient below 0, from the sums alone: Lawson and Hanson's active set (Solving Least Squares Problems, 1974,
//! chapter 23) on the normal equations of a handful of columns.

/// Largest number of columns.
pub(crate) const MOST: usize = 4;
/// A column of which less than this share is left beside the others is one of them.
const DEPENDENT: f64 = 1e-12;

/// The sums of a linear problem: `gram` = Σ w φ_i φ_j (k × k, row by row with `stride`), `by` = Σ w φ_i y.
#[derive(Clone, Copy)]
pub(crate) struct Sums<'a> {
    pub gram: &'a [f64],
    pub stride: usize,
    pub by: &'a [f64],
    pub columns: usize,
}

impl Sums<'_> {
    fn g(&self, i: usize, j: usize) -> f64 {
        self.gram[i * self.stride + j]
    }

    /// Coefficients ≥ 0 that leave the smallest squares, and by how much they lower Σ w y².
    pub(crate) fn solve(&self) -> ([f64; MOST], f64) {
        let k = self.columns.min(MOST);
        let mut x = [0.0; MOST];
        let mut passive = [false; MOST];
        let mut barred = [false; MOST];
        // most often every coefficient is positive
        if k > 0 {
            let all = [0, 1, 2, 3].map(|i| i < k);
            if let Some(y) = self.unbounded(&all)
                && (0..k).all(|i| y[i] > 0.0)
            {
                return (y, self.gain(&y));
            }
        }
        for _ in 0..4 * MOST {
            let slope = |i: usize| self.by[i] - (0..k).map(|j| self.g(i, j) * x[j]).sum::<f64>();
            let scale = |i: usize| self.g(i, i).sqrt();
            let next = (0..k)
                .filter(|&i| !passive[i] && !barred[i] && scale(i) > 0.0)
                .map(|i| (i, slope(i) / scale(i)))
                .max_by(|a, b| a.1.total_cmp(&b.1));
            let floor = 1e-14
                * (0..k).filter(|&i| scale(i) > 0.0).map(|i| self.by[i].abs() / scale(i)).fold(0.0, f64::max);
            let Some((i, s)) = next else { break };
            if s.is_nan() || s <= floor {
                break;
            }
            passive[i] = true;
            loop {
                let Some(y) = self.unbounded(&passive) else {
                    passive[i] = false;
                    barred[i] = true;
                    break;
                };
                if (0..k).all(|j| !passive[j] || y[j] > 0.0) {
                    x = y;
                    break;
                }
                // walk towards y until the first coefficient reaches 0
                let step = (0..k)
                    .filter(|&j| passive[j] && y[j] <= 0.0)
                    .map(|j| x[j] / (x[j] - y[j]).max(f64::MIN_POSITIVE))
                    .fold(1.0, f64::min);
                for j in 0..k {
                    x[j] += step * (y[j] - x[j]) * f64::from(u8::from(passive[j]));
                    if passive[j] && x[j] <= 1e-15 * y[j].abs() {
                        (x[j], passive[j]) = (0.0, false);
                    }
                }
                if !passive.contains(&true) {
                    break;
                }
            }
        }
        (x, self.gain(&x))
    }

    /// Σ w y² − Σ w (y − φx)² = 2 x·b − x·Gx.
    fn gain(&self, x: &[f64; MOST]) -> f64 {
        let k = self.columns.min(MOST);
        (0..k).map(|i| x[i] * (2.0 * self.by[i] - (0..k).map(|j| self.g(i, j) * x[j]).sum::<f64>())).sum()
    }

    /// The unbounded solution over some columns; `None` where they depend on each other.
    fn unbounded(&self, passive: &[bool; MOST]) -> Option<[f64; MOST]> {
        let mut l = [[0.0; MOST]; MOST];
        let mut z = [0.0; MOST];
        let k = self.columns.min(MOST);
        for i in (0..k).filter(|&i| passive[i]) {
            for j in (0..=i).filter(|&j| passive[j]) {
                let rest = self.g(i, j) - (0..j).map(|m| l[i][m] * l[j][m]).sum::<f64>();
                if i == j {
                    if rest.is_nan() || rest <= DEPENDENT * self.g(i, i) {
                        return None;
                    }
                    l[i][i] = rest.sqrt();
                } else {
                    l[i][j] = rest / l[j][j];
                }
            }
            z[i] = (self.by[i] - (0..i).map(|m| l[i][m] * z[m]).sum::<f64>()) / l[i][i];
        }
        let mut x = [0.0; MOST];
        for i in (0..k).rev().filter(|&i| passive[i]) {
            x[i] = (z[i] - (i + 1..k).map(|m| l[m][i] * x[m]).sum::<f64>()) / l[i][i];
        }
        Some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The best of all 2^k choices of columns, by elimination on the data.
    fn by_all_subsets(columns: &[Vec<f64>], y: &[f64]) -> f64 {
        let k = columns.len();
        let mut best = y.iter().map(|v| v * v).sum::<f64>();
        for choice in 1..1usize << k {
            let some: Vec<usize> = (0..k).filter(|i| choice >> i & 1 == 1).collect();
            let a = nalgebra::DMatrix::from_fn(y.len(), some.len(), |i, j| columns[some[j]][i]);
            let b = nalgebra::DVector::from_row_slice(y);
            let Ok(x) = a.clone().svd(true, true).solve(&b, 1e-12) else { continue };
            if x.iter().all(|v| *v >= 0.0) {
                best = best.min((b - a * x).norm_squared());
            }
        }
        best
    }

    proptest! {
        #[test]
        fn no_choice_of_columns_does_better(seed in proptest::collection::vec(-1.0..1.0f64, 60), k in 1usize..5) {
            let columns: Vec<Vec<f64>> = (0..k).map(|c| (0..12).map(|i| seed[c * 12 + i] + 0.3).collect()).collect();
            let y: Vec<f64> = (0..12).map(|i| seed[48 + i] + 0.2).collect();
            let gram: Vec<f64> = (0..k * k).map(|p| columns[p / k].iter().zip(&columns[p % k]).map(|(a, b)| a * b).sum()).collect();
            let by: Vec<f64> = columns.iter().map(|c| c.iter().zip(&y).map(|(a, b)| a * b).sum()).collect();
            let (x, gain) = Sums { gram: &gram, stride: k, by: &by, columns: k }.solve();
            prop_assert!(x.iter().all(|v| *v >= 0.0));
            let left = y.iter().map(|v| v * v).sum::<f64>() - gain;
            prop_assert!((left - by_all_subsets(&columns, &y)).abs() < 1e-9, "{left}");
        }
    }

    #[test]
    fn columns_that_repeat_or_are_empty_do_no_harm() {
        let gram = [1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        let (x, gain) = Sums { gram: &gram, stride: 3, by: &[2.0, 2.0, 0.0], columns: 3 }.solve();
        assert!((x[0] + x[1] - 2.0).abs() < 1e-12 && x[2] == 0.0 && (gain - 4.0).abs() < 1e-12, "{x:?}");
        let nan = [f64::NAN; 4];
        assert_eq!(Sums { gram: &nan, stride: 2, by: &nan, columns: 2 }.solve().0, [0.0; MOST]);
    }
}
