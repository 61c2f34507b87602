//! The base beside a gloss: log f as a quadratic in two angles, fitted to the pixels around and carried on underneath.
//!
//! The logarithm of a lobe is nearly a parabola over a few degrees, and a parabola's exponential is never negative. Where the base is lost in
//! its own noise (black glass) a plane in f takes its place: the logarithm of noise about zero means nothing.

use nalgebra::{SMatrix, SVector};

/// A pixel: place in units of the outer radius, f and its variance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) f: f64,
    pub(super) variance: f64,
}

/// Terms of the quadratic.
const TERMS: usize = 6;
/// Steps of Gauss and Newton after the start from the logarithms.
const STEPS: usize = 4;
/// Mean of f over its noise from which on the logarithm is used.
const CLEAR: f64 = 8.0;
/// Error of the form itself, relative: keeps exact data from counting without limit.
const OWN_ERROR: f64 = 1e-3;

type Vector = SVector<f64, TERMS>;
type Matrix = SMatrix<f64, TERMS, TERMS>;

/// A fitted surface.
#[derive(Clone, Debug)]
pub(super) struct LocalBase {
    logarithmic: bool,
    coefficients: Vector,
    covariance: Matrix,
    /// Variance of the form itself, relative to f² for the exponential.
    form: f64,
}

fn basis(x: f64, y: f64) -> Vector {
    Vector::from([1.0, x, y, x * x, x * y, y * y])
}

impl LocalBase {
    /// The surface through the points; `None` where they are too few or lie so that they do not determine it.
    pub(super) fn fit(points: &[Point]) -> Option<Self> {
        if points.len() < 3 * TERMS {
            return None;
        }
        let n = points.len() as f64;
        let mean = points.iter().map(|p| p.f).sum::<f64>() / n;
        let noise = (points.iter().map(|p| p.variance).sum::<f64>() / n).sqrt();
        let lowest = points.iter().map(|p| p.f).fold(f64::INFINITY, f64::min);
        if mean > CLEAR * noise && lowest > 0.0 { Self::exponential(points) } else { Self::plane(points) }
    }

    fn exponential(points: &[Point]) -> Option<Self> {
        // log f has the variance var/f²
        let (m, r) = normal(points, |p| {
            let own = OWN_ERROR * OWN_ERROR;
            (basis(p.x, p.y), p.f.ln(), 1.0 / (p.variance / (p.f * p.f) + own))
        });
        let mut c = m.cholesky()?.solve(&r);
        let mut covariance = m;
        for _ in 0..STEPS {
            let (m, r) = normal(points, |p| {
                let b = basis(p.x, p.y);
                let f = b.dot(&c).clamp(-60.0, 60.0).exp();
                (b * f, p.f - f, 1.0 / (p.variance + (OWN_ERROR * f).powi(2)))
            });
            c += m.cholesky()?.solve(&r);
            covariance = m;
        }
        let covariance = covariance.try_inverse()?;
        let out = Self { logarithmic: true, coefficients: c, covariance, form: 0.0 }.own_error(points);
        c.iter().all(|v| v.is_finite()).then_some(out)
    }

    fn plane(points: &[Point]) -> Option<Self> {
        let (mut m, r) = normal(points, |p| {
            let mut b = basis(p.x, p.y);
            b.fixed_rows_mut::<3>(3).fill(0.0);
            (b, p.f, 1.0 / p.variance.max(f64::MIN_POSITIVE.sqrt()))
        });
        for k in 3..TERMS {
            m[(k, k)] = 1.0;
        }
        let c = m.cholesky()?.solve(&r);
        let mut covariance = m.try_inverse()?;
        for k in 3..TERMS {
            covariance[(k, k)] = 0.0;
        }
        let out = Self { logarithmic: false, coefficients: c, covariance, form: 0.0 }.own_error(points);
        c.iter().all(|v| v.is_finite()).then_some(out)
    }

    /// Residuals beyond what the points' noise explains are the form's own error. They do not average out under the gloss, so they stand beside
    /// the covariance undivided.
    fn own_error(mut self, points: &[Point]) -> Self {
        let (mut squares, mut explained, mut scale) = (0.0, 0.0, 0.0);
        for p in points {
            let f = self.at(p.x, p.y);
            squares += (p.f - f).powi(2);
            explained += p.variance;
            scale += f * f;
        }
        let excess = (squares - explained).max(0.0);
        self.form = if self.logarithmic { excess / scale } else { excess / points.len() as f64 };
        self
    }

    /// f at a place.
    pub(super) fn at(&self, x: f64, y: f64) -> f64 {
        let v = basis(x, y).dot(&self.coefficients);
        if self.logarithmic { v.clamp(-60.0, 60.0).exp() } else { v }
    }

    /// Variance of f there.
    pub(super) fn variance(&self, x: f64, y: f64) -> f64 {
        let b = basis(x, y);
        let v = (b.transpose() * self.covariance * b)[0].max(0.0) + self.form;
        if self.logarithmic { v * self.at(x, y).powi(2) } else { v }
    }
}

/// Normal equations of rows (derivatives, right-hand side, weight).
fn normal(points: &[Point], row: impl Fn(&Point) -> (Vector, f64, f64)) -> (Matrix, Vector) {
    let (mut m, mut r) = (Matrix::zeros(), Vector::zeros());
    for p in points {
        let (b, y, w) = row(p);
        m += b * b.transpose() * w;
        r += b * (y * w);
    }
    (m, r)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(f: impl Fn(f64, f64) -> f64, sigma: f64) -> Vec<Point> {
        let side = (-20..=20).map(|k| f64::from(k) / 20.0);
        side.clone()
            .flat_map(|x| side.clone().map(move |y| (x, y)))
            .filter(|(x, y)| (0.3..1.0).contains(&x.hypot(*y)))
            .map(|(x, y)| Point { x, y, f: f(x, y), variance: sigma * sigma })
            .collect()
    }

    #[test]
    fn a_lobe_is_carried_on_under_its_hidden_top() {
        // a Gaussian on a floor, as wide as the ring: the form nearly fits
        let f = |x: f64, y: f64| 0.2 + 3.0 * (-0.7 * ((x - 0.1).powi(2) + y * y)).exp();
        let base = LocalBase::fit(&ring(f, 1e-3)).unwrap();
        assert!(
            (base.at(0.0, 0.0) / f(0.0, 0.0) - 1.0).abs() < 0.01,
            "{} {}",
            base.at(0.0, 0.0),
            f(0.0, 0.0)
        );
        // half as wide it fits badly, and says so
        let f = |x: f64, y: f64| 0.2 + 3.0 * (-2.8 * ((x - 0.1).powi(2) + y * y)).exp();
        let base = LocalBase::fit(&ring(f, 1e-3)).unwrap();
        let (got, want, sigma) = (base.at(0.0, 0.0), f(0.0, 0.0), base.variance(0.0, 0.0).sqrt());
        assert!((got / want - 1.0).abs() > 0.03 && (got - want).abs() < 3.0 * sigma, "{got} {want} {sigma}");
        // and exactly, where the form is right
        let f = |x: f64, y: f64| (1.0 + 0.3 * x - 1.7 * x * x - 0.8 * y * y).exp();
        let base = LocalBase::fit(&ring(f, 1e-4)).unwrap();
        assert!((base.at(0.0, 0.0) / f(0.0, 0.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn noise_about_zero_is_met_by_a_plane() {
        let f = |x: f64, y: f64| 0.01 * (57.0 * x + 91.0 * y).sin();
        let base = LocalBase::fit(&ring(f, 0.007)).unwrap();
        assert!(!base.logarithmic && base.at(0.0, 0.0).abs() < 2e-3);
    }

    #[test]
    fn too_few_points_and_a_line_of_points_determine_nothing() {
        let line: Vec<Point> =
            (0..100).map(|k| Point { x: f64::from(k) / 100.0, y: 0.0, f: 1.0, variance: 1e-6 }).collect();
        assert!(LocalBase::fit(&line).is_none());
        assert!(LocalBase::fit(&line[..10]).is_none());
    }
}
