//! Interpolation where neighbours are missing: the value at a point of the surface fitted to those that are there.
//!
//! Weighted least squares with a quadratic, a plane or a constant, whichever the neighbours can carry without
//! amplifying noise; linear in the values, so it comes as one weight per neighbour. A renormalised mean would shift the
//! point towards the side where neighbours are left: on the flank of a lobe that is a bias of percents.

/// A neighbour: its offset from the point in lattice steps, and its weight in the result.
#[derive(Clone, Copy, Debug, Default)]
pub struct Neighbour {
    /// Offset along columns.
    pub x: f64,
    /// Offset along rows.
    pub y: f64,
    /// Result: weight of its value.
    pub weight: f64,
}

/// Sum of the magnitudes of the weights up to which a fit is accepted.
const MOST_AMPLIFIED: f64 = 2.5;

/// Fills in the weights; `false` without neighbours.
pub fn weigh(neighbours: &mut [Neighbour]) -> bool {
    [6usize, 3, 1].into_iter().any(|terms| neighbours.len() >= terms && fit(neighbours, terms))
}

fn basis(n: &Neighbour) -> [f64; 6] {
    [1.0, n.x, n.y, n.x * n.x, n.x * n.y, n.y * n.y]
}

/// Nearer neighbours count more; the width is narrow where a lower order would smooth.
fn closeness(n: &Neighbour, terms: usize) -> f64 {
    let width = if terms == 6 { 1.5 } else { 0.6 };
    (-(n.x * n.x + n.y * n.y) / (2.0 * width * width)).exp()
}

fn fit(neighbours: &mut [Neighbour], terms: usize) -> bool {
    // normal equations M c = e1; the weight of neighbour i is g_i φ_i · c
    let mut m = [[0.0f64; 7]; 6];
    for n in neighbours.iter() {
        let (b, g) = (basis(n), closeness(n, terms));
        for (row, bi) in m.iter_mut().zip(&b).take(terms) {
            for (v, bj) in row.iter_mut().zip(&b).take(terms) {
                *v += g * bi * bj;
            }
        }
    }
    m[0][6] = 1.0;
    let scale = m[0][0];
    for k in 0..terms {
        let pivot = (k..terms).max_by(|&a, &b| m[a][k].abs().total_cmp(&m[b][k].abs())).unwrap_or(k);
        m.swap(k, pivot);
        if m[k][k].abs() < 1e-6 * scale {
            return false;
        }
        let row = m[k];
        for other in m.iter_mut().take(terms).skip(k + 1) {
            let f = other[k] / row[k];
            for (v, r) in other.iter_mut().zip(&row).skip(k) {
                *v -= f * r;
            }
        }
    }
    let mut c = [0.0f64; 6];
    for k in (0..terms).rev() {
        let known: f64 = (k + 1..terms).map(|j| m[k][j] * c[j]).sum();
        c[k] = (m[k][6] - known) / m[k][k];
    }
    let mut amplified = 0.0;
    for n in neighbours.iter_mut() {
        let b = basis(n);
        n.weight = closeness(n, terms) * (0..terms).map(|j| b[j] * c[j]).sum::<f64>();
        amplified += n.weight.abs();
    }
    amplified <= MOST_AMPLIFIED
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_one_sided_neighbourhood_still_meets_a_tilted_plane_at_the_point() {
        let mut n: Vec<Neighbour> = (0..4)
            .flat_map(|i| {
                (0..2).map(move |j| Neighbour { x: f64::from(i) - 1.3, y: f64::from(j) + 0.2, weight: 0.0 })
            })
            .collect();
        assert!(weigh(&mut n));
        let f = |x: f64, y: f64| 3.0 + 0.5 * x - 2.0 * y;
        let got: f64 = n.iter().map(|p| p.weight * f(p.x, p.y)).sum();
        assert!((got - 3.0).abs() < 1e-9, "{got}");
    }

    #[test]
    fn a_single_neighbour_stands_for_the_point() {
        let mut n = [Neighbour { x: 0.4, y: 0.1, weight: 0.0 }];
        assert!(weigh(&mut n) && (n[0].weight - 1.0).abs() < 1e-12);
        assert!(!weigh(&mut []));
    }
}
