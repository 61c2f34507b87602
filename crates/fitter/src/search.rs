//! One-dimensional minimisation by Brent's method (Brent 1973, chapter 5): parabolas where they help, golden section where they do not.

/// Where the minimum of `f` on [a, b] is found, and its value. Not-a-number counts as large.
pub(crate) fn minimise(a: f64, b: f64, tolerance: f64, mut f: impl FnMut(f64) -> f64) -> (f64, f64) {
    const GOLDEN: f64 = 0.381_966_011_250_105;
    let mut f = |x: f64| {
        let y = f(x);
        if y.is_nan() { f64::INFINITY } else { y }
    };
    let (mut a, mut b) = (a.min(b), a.max(b));
    let mut x = a + GOLDEN * (b - a);
    let (mut w, mut v) = (x, x);
    let mut fx = f(x);
    let (mut fw, mut fv) = (fx, fx);
    let (mut step, mut before) = (0.0f64, 0.0f64);
    for _ in 0..80 {
        let middle = 0.5 * (a + b);
        let tol = tolerance + f64::EPSILON * x.abs();
        if (x - middle).abs() <= 2.0 * tol - 0.5 * (b - a) {
            break;
        }
        let mut parabola = None;
        if before.abs() > tol {
            let r = (x - w) * (fx - fv);
            let q = (x - v) * (fx - fw);
            let p = (x - v) * q - (x - w) * r;
            let q = 2.0 * (q - r);
            let (p, q) = if q > 0.0 { (-p, q) } else { (p, -q) };
            if p.abs() < (0.5 * q * before).abs() && p > q * (a - x) && p < q * (b - x) {
                parabola = Some(p / q);
            }
        }
        if let Some(d) = parabola {
            before = step;
            step = d;
            let u = x + step;
            if u - a < 2.0 * tol || b - u < 2.0 * tol {
                step = tol.copysign(middle - x);
            }
        } else {
            before = if x < middle { b - x } else { a - x };
            step = GOLDEN * before;
        }
        let u = x + if step.abs() >= tol { step } else { tol.copysign(step) };
        let fu = f(u);
        if fu <= fx {
            if u < x {
                b = x;
            } else {
                a = x;
            }
            (v, fv, w, fw, x, fx) = (w, fw, x, fx, u, fu);
        } else {
            if u < x {
                a = u;
            } else {
                b = u;
            }
            if fu <= fw || w == x {
                (v, fv, w, fw) = (w, fw, u, fu);
            } else if fu <= fv || v == x || v == w {
                (v, fv) = (u, fu);
            }
        }
    }
    (x, fx)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_takes_few_steps_and_a_corner_is_found() {
        let mut count = 0;
        let (x, _) = minimise(-3.0, 5.0, 1e-9, |x| {
            count += 1;
            (x - 1.25).powi(2)
        });
        assert!((x - 1.25).abs() < 1e-8 && count < 12, "{x} after {count}");
        assert!((minimise(0.0, 2.0, 1e-9, |x| (x - 0.7).abs()).0 - 0.7).abs() < 1e-8);
    }

    #[test]
    fn a_minimum_at_the_edge_and_a_function_without_numbers_end() {
        assert!(minimise(0.0, 1.0, 1e-6, |x| x).0 < 1e-5);
        assert!((0.0..=1.0).contains(&minimise(0.0, 1.0, 1e-6, |_| f64::NAN).0));
    }
}
