//! Numbers that carry their derivatives (forward mode): a formula written once gives its value and an exact Jacobian.
//!
//! A term of a model depends on at most three nonlinear parameters of its own and on the index of a coat, so four derivatives do.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Derivatives a [`Dual`] carries: three parameters of a term and the index of the coat.
pub(crate) const SLOTS: usize = 4;
/// The slot of the coat's index.
pub(crate) const INDEX_SLOT: usize = 3;

/// What the formulas of the models need of a number.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// A number without derivatives.
    fn constant(v: f64) -> Self;
    /// The value alone.
    fn value(self) -> f64;
    /// e^x.
    fn exp(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// Square root; the derivative at 0 counts as 0.
    fn sqrt(self) -> Self;
    /// Sine and cosine.
    fn sin_cos(self) -> (Self, Self);
    /// ln(1 + x), exact for small x.
    fn ln_1p(self) -> Self;
    /// Times a plain number.
    fn times(self, k: f64) -> Self;
    /// Plus a plain number.
    fn plus(self, k: f64) -> Self;

    /// The square.
    fn squared(self) -> Self {
        self * self
    }
    /// The larger of this and a plain number; beyond it the derivative is 0.
    fn at_least(self, low: f64) -> Self {
        if self.value() >= low { self } else { Self::constant(low) }
    }
    /// The larger of two.
    fn larger(self, o: Self) -> Self {
        if self.value() >= o.value() { self } else { o }
    }
    /// The smaller of two.
    fn smaller(self, o: Self) -> Self {
        if self.value() <= o.value() { self } else { o }
    }
}

impl Number for f64 {
    fn constant(v: f64) -> Self {
        v
    }
    fn value(self) -> f64 {
        self
    }
    fn exp(self) -> Self {
        self.exp()
    }
    fn ln(self) -> Self {
        self.ln()
    }
    fn sqrt(self) -> Self {
        self.max(0.0).sqrt()
    }
    fn sin_cos(self) -> (Self, Self) {
        self.sin_cos()
    }
    fn ln_1p(self) -> Self {
        self.ln_1p()
    }
    fn times(self, k: f64) -> Self {
        self * k
    }
    fn plus(self, k: f64) -> Self {
        self + k
    }
}

/// A value and its derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Dual {
    pub v: f64,
    pub d: [f64; SLOTS],
}

impl Dual {
    /// The variable of a slot.
    pub(crate) fn variable(v: f64, slot: usize) -> Self {
        let mut d = [0.0; SLOTS];
        d[slot] = 1.0;
        Self { v, d }
    }

    /// f(x) with the derivative f'(x).
    fn chain(self, v: f64, slope: f64) -> Self {
        Self { v, d: self.d.map(|d| d * slope) }
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self { v: self.v + o.v, d: std::array::from_fn(|i| self.d[i] + o.d[i]) }
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self { v: self.v - o.v, d: std::array::from_fn(|i| self.d[i] - o.d[i]) }
    }
}

#[allow(clippy::suspicious_arithmetic_impl)] // the product rule is a sum
impl Mul for Dual {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self { v: self.v * o.v, d: std::array::from_fn(|i| self.d[i] * o.v + self.v * o.d[i]) }
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let (v, r) = (self.v / o.v, 1.0 / o.v);
        Self { v, d: std::array::from_fn(|i| (self.d[i] - v * o.d[i]) * r) }
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        self.chain(-self.v, -1.0)
    }
}

impl Number for Dual {
    fn constant(v: f64) -> Self {
        Self { v, d: [0.0; SLOTS] }
    }
    fn value(self) -> f64 {
        self.v
    }
    fn exp(self) -> Self {
        let e = self.v.exp();
        self.chain(e, e)
    }
    fn ln(self) -> Self {
        self.chain(self.v.ln(), 1.0 / self.v)
    }
    fn sqrt(self) -> Self {
        let s = self.v.max(0.0).sqrt();
        self.chain(s, if s > 0.0 { 0.5 / s } else { 0.0 })
    }
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.v.sin_cos();
        (self.chain(s, c), self.chain(c, -s))
    }
    fn ln_1p(self) -> Self {
        self.chain(self.v.ln_1p(), 1.0 / (1.0 + self.v))
    }
    fn times(self, k: f64) -> Self {
        self.chain(self.v * k, k)
    }
    fn plus(self, k: f64) -> Self {
        Self { v: self.v + k, d: self.d }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn formula<T: Number>(x: T, y: T) -> T {
        let (s, c) = (x * y).sin_cos();
        (s.plus(2.0) / (c.squared().plus(1.0)) - (x.exp() * y.sqrt()).ln_1p().times(0.3))
            * (-y).plus(3.0).ln()
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let (x, y) = (0.7, 1.3);
        let d = formula(Dual::variable(x, 0), Dual::variable(y, 3));
        assert_eq!(d.v, formula(x, y));
        let h = 1e-6;
        let by_x = (formula(x + h, y) - formula(x - h, y)) / (2.0 * h);
        let by_y = (formula(x, y + h) - formula(x, y - h)) / (2.0 * h);
        assert!((d.d[0] - by_x).abs() < 1e-8 && (d.d[3] - by_y).abs() < 1e-8, "{d:?} {by_x} {by_y}");
        assert_eq!(d.d[1], 0.0);
    }
}
