//! The iteration (4.8) with the rule for λ, and what can be said of its end.

use std::f64::consts::FRAC_1_PI;

use nalgebra::{DMatrix, DVector};

use super::SoppOptions;

/// λ is halved until it falls below this.
const LAMBDA_MIN: f64 = 1e-4;
/// A residual that makes a smaller cosine than this with every derivative is at a minimum.
const RIGHT_ANGLE: f64 = 1e-4;

/// What the model needs of a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub ln_nh: f64,
    /// 1/(8π (h·v) max(n·l, n·v)).
    pub shape: f64,
    /// (1 − h·v)^5.
    pub grazing: f64,
    /// Diffuse term of (4.17) without 1 − R_s.
    pub diffuse_full: f64,
    /// Factor of the residual.
    pub weight: f64,
}

/// Parameters of one channel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub exponent: f64,
    pub diffuse: f64,
    pub specular: f64,
    pub r0: f64,
}

/// Which parameters move.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    pub fresnel: bool,
    pub exponent_fixed: bool,
    pub limited: bool,
}

/// How an iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// At a minimum: the residual makes a cosine below 1e-4 with every derivative.
    Settled,
    /// λ is above its limit, the step is worse, and no further one will be tried: a minimum was not reached.
    Stuck,
    /// The iterations are used up on the way.
    Unfinished,
    /// The system of equations could not be solved, or numbers ceased to be finite.
    Broken,
}

/// One run of the iteration.
#[derive(Clone, Debug)]
pub struct Stage {
    /// What was fitted: `mean`, `mean, Fresnel`, `red`, `green`, `blue`.
    pub name: &'static str,
    /// How it ended.
    pub ended: Ended,
    /// Better steps.
    pub accepted: usize,
    /// Worse steps, dropped.
    pub rejected: usize,
    /// Last λ.
    pub lambda: f64,
    /// Largest cosine between the residual and a derivative at the end; 0 at a minimum.
    pub cosine: f64,
    /// Condition number of DᵀD at the end, as the equations are solved (columns not scaled).
    pub condition: f64,
    /// The same with columns of length 1.
    pub condition_scaled: f64,
    /// Smallest diagonal element of DᵀD at the end: what a Cholesky decomposition meets as a pivot.
    pub smallest_pivot: f64,
    /// Sum of squares after each iteration, the start first.
    pub squares: Vec<f64>,
}

impl Ended {
    /// In a word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Settled => "settled",
            Self::Stuck => "stuck",
            Self::Unfinished => "unfinished",
            Self::Broken => "broken",
        }
    }
}

impl Form {
    fn count(self) -> usize {
        2 + usize::from(!self.exponent_fixed) + usize::from(self.fresnel && !self.exponent_fixed)
    }

    fn vector(self, p: Point) -> DVector<f64> {
        let mut a = vec![p.diffuse, p.specular];
        if !self.exponent_fixed {
            a.push(p.exponent);
            if self.fresnel {
                a.push(p.r0);
            }
        }
        DVector::from_vec(a)
    }

    fn point(self, a: &DVector<f64>, fixed: Point) -> Point {
        let mut p = Point { diffuse: a[0], specular: a[1], ..fixed };
        if !self.exponent_fixed {
            p.exponent = a[2];
            if self.fresnel {
                p.r0 = a[3];
            }
        }
        if self.limited {
            p.diffuse = p.diffuse.max(0.0);
            p.specular = p.specular.max(0.0);
            p.exponent = p.exponent.clamp(1.0, 1e5);
            p.r0 = p.r0.clamp(0.0, 1.0);
        }
        p
    }
}

/// Model value and derivatives by cd, cs, n, R_s.
fn model(node: &Node, p: Point, fresnel: bool) -> (f64, [f64; 4]) {
    let power = (p.exponent * node.ln_nh).exp();
    let lobe = (p.exponent + 1.0) * power * node.shape;
    let by_exponent = (1.0 + (p.exponent + 1.0) * node.ln_nh) * power * node.shape;
    if !fresnel {
        let value = p.diffuse * FRAC_1_PI + p.specular * lobe;
        return (value, [FRAC_1_PI, lobe, p.specular * by_exponent, 0.0]);
    }
    let f = p.r0 + (1.0 - p.r0) * node.grazing;
    let diffuse = (1.0 - p.r0) * node.diffuse_full;
    let by_r0 = p.specular * lobe * (1.0 - node.grazing) - p.diffuse * node.diffuse_full;
    (p.diffuse * diffuse + p.specular * lobe * f, [diffuse, lobe * f, p.specular * by_exponent * f, by_r0])
}

fn squares(nodes: &[Node], values: &[f64], p: Point, fresnel: bool) -> f64 {
    nodes.iter().zip(values).map(|(n, y)| (n.weight * (model(n, p, fresnel).0 - y)).powi(2)).sum()
}

/// DᵀD, Dᵀr and rᵀr.
fn equations(nodes: &[Node], values: &[f64], p: Point, form: Form) -> (DMatrix<f64>, DVector<f64>, f64) {
    let m = form.count();
    let (mut matrix, mut right, mut sum) = (DMatrix::zeros(m, m), DVector::zeros(m), 0.0);
    for (n, y) in nodes.iter().zip(values) {
        let (value, d) = model(n, p, form.fresnel);
        let d = d.map(|x| x * n.weight);
        let r = n.weight * (value - y);
        sum += r * r;
        for i in 0..m {
            right[i] += d[i] * r;
            for j in 0..=i {
                matrix[(i, j)] += d[i] * d[j];
            }
        }
    }
    for i in 0..m {
        for j in 0..i {
            matrix[(j, i)] = matrix[(i, j)];
        }
    }
    (matrix, right, sum)
}

/// Runs (4.8) from `start`.
pub(super) fn iterate(
    name: &'static str,
    nodes: &[Node],
    values: &[f64],
    start: Point,
    form: Form,
    options: &SoppOptions,
) -> (Point, Stage) {
    let mut p = form.point(&form.vector(start), start);
    let mut lambda = options.lambda;
    let mut eq = equations(nodes, values, p, form);
    let mut stage = Stage {
        name,
        ended: Ended::Unfinished,
        accepted: 0,
        rejected: 0,
        lambda,
        cosine: f64::NAN,
        condition: f64::NAN,
        condition_scaled: f64::NAN,
        smallest_pivot: f64::NAN,
        squares: vec![eq.2],
    };
    for _ in 0..options.iterations {
        let mut damped = eq.0.clone();
        for i in 0..damped.nrows() {
            damped[(i, i)] *= 1.0 + lambda;
        }
        let Some(cholesky) = damped.cholesky() else {
            stage.ended = Ended::Broken;
            break;
        };
        let trial = form.point(&(form.vector(p) - cholesky.solve(&eq.1)), p);
        let error = squares(nodes, values, trial, form.fresnel);
        if error < eq.2 {
            p = trial;
            eq = equations(nodes, values, p, form);
            stage.accepted += 1;
            if lambda > LAMBDA_MIN {
                lambda /= 2.0;
            }
        } else {
            stage.rejected += 1;
            if lambda > options.lambda_max {
                // neither λ nor the parameters change any more: all further iterations repeat this one
                stage.squares.push(eq.2);
                stage.ended = Ended::Stuck;
                break;
            }
            lambda *= 2.0;
        }
        stage.squares.push(eq.2);
    }
    stage.lambda = lambda;
    stage.cosine = cosine(&eq);
    if !eq.2.is_finite() {
        stage.ended = Ended::Broken;
    } else if stage.cosine < RIGHT_ANGLE && stage.ended != Ended::Broken {
        stage.ended = Ended::Settled;
    }
    (stage.condition, stage.condition_scaled) = conditions(&eq.0);
    stage.smallest_pivot = eq.0.diagonal().min();
    (p, stage)
}

/// Largest |dᵀr|/(|d| |r|) over the derivatives d; 0 where nothing is left to explain.
fn cosine((matrix, right, sum): &(DMatrix<f64>, DVector<f64>, f64)) -> f64 {
    if *sum <= 1e-24 {
        return 0.0;
    }
    (0..right.len())
        .map(|i| right[i].abs() / (matrix[(i, i)] * sum).sqrt().max(f64::MIN_POSITIVE))
        .fold(0.0, f64::max)
}

/// Condition numbers of DᵀD as it is and with unit diagonal; infinite where it is singular.
fn conditions(matrix: &DMatrix<f64>) -> (f64, f64) {
    if matrix.iter().any(|x| !x.is_finite()) {
        return (f64::INFINITY, f64::INFINITY);
    }
    let of = |m: DMatrix<f64>| {
        let values = m.symmetric_eigenvalues();
        let (low, high) = (values.min(), values.max());
        if low > 0.0 { high / low } else { f64::INFINITY }
    };
    let mut scaled = matrix.clone();
    for i in 0..matrix.nrows() {
        for j in 0..matrix.nrows() {
            scaled[(i, j)] /= (matrix[(i, i)] * matrix[(j, j)]).sqrt().max(f64::MIN_POSITIVE);
        }
    }
    (of(matrix.clone()), of(scaled))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_model() {
        let node = Node { ln_nh: 0.97f64.ln(), shape: 0.06, grazing: 0.01, diffuse_full: 0.28, weight: 1.0 };
        for fresnel in [false, true] {
            let p = Point { exponent: 40.0, diffuse: 0.3, specular: 0.2, r0: 0.1 };
            let (_, d) = model(&node, p, fresnel);
            let shifted = [
                Point { diffuse: p.diffuse + 1e-6, ..p },
                Point { specular: p.specular + 1e-6, ..p },
                Point { exponent: p.exponent + 1e-6, ..p },
                Point { r0: p.r0 + 1e-6, ..p },
            ];
            for (q, d) in shifted.into_iter().zip(d) {
                let difference = (model(&node, q, fresnel).0 - model(&node, p, fresnel).0) / 1e-6;
                assert!((difference - d).abs() < 1e-5 * (1.0 + d.abs()), "{difference} against {d}");
            }
        }
    }

    #[test]
    fn a_singular_system_has_no_condition() {
        let m = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 1.0, 1.0]);
        assert!(conditions(&m).1 > 1e12);
        let m = DMatrix::from_row_slice(2, 2, &[1e6, 0.0, 0.0, 1.0]);
        assert_eq!(conditions(&m), (1e6, 1.0));
    }
}
