//! Lobes that are `g(x) · k · e^(−x u)`: x the exponent or 1/α², u and k functions of the directions alone.
//!
//! (n·h)^n is e^(−n u) with u = −ln(n·h); Beckmann's and Ward's exp(−tan² θh/α²) has u = tan² θh and x = 1/α². Schlick's factor splits a lobe into
//! r0 P + (1 − r0) Q, Q with k (1 − h·v)^5.

use std::f64::consts::{PI, TAU};

use crate::{ray::Ray, term::Term};

/// u, k and (1 − h·v)^5 at a pair of directions; `None` where the lobe is 0 for every x.
pub(crate) fn at(term: Term, r: &Ray<f64>) -> Option<(f64, f64, f64)> {
    let [l, v] = r.cos;
    let cosine = |sin2: f64| -0.5 * (-sin2).ln_1p();
    let tan2 = |sin2: f64| sin2 / (1.0 - sin2);
    let (u, k) = match term {
        Term::BlinnPhong => (cosine(r.sin2), 1.0 / (8.0 * PI)),
        Term::Ashikhmin | Term::AshikhminFresnel => (cosine(r.sin2), (8.0 * PI * r.hv * l.max(v)).recip()),
        Term::Phong if r.below < 1.0 => (cosine(r.below * (2.0 - r.below)), 1.0 / TAU),
        Term::Ward => (tan2(r.sin2), (4.0 * PI * (l * v).sqrt()).recip()),
        Term::WardDuer => (tan2(r.sin2), (4.0 * PI * l * v).recip()),
        Term::CookTorrance => {
            let c2 = 1.0 - r.sin2;
            let g = (1.0 / (l * v)).min(2.0 * c2.sqrt() / (r.hv * l.max(v)));
            (tan2(r.sin2), 0.25 * g / (PI * c2 * c2))
        }
        _ => return None,
    };
    let k = k * r.throughput;
    (u.is_finite() && k.is_finite()).then_some((u, k, r.rise))
}

/// Whether a term is of this form.
pub(crate) const fn serves(term: Term) -> bool {
    matches!(
        term,
        Term::BlinnPhong
            | Term::Ashikhmin
            | Term::AshikhminFresnel
            | Term::Phong
            | Term::Ward
            | Term::WardDuer
            | Term::CookTorrance
    )
}

/// Whether it carries Schlick's factor.
pub(crate) const fn has_fresnel(term: Term) -> bool {
    matches!(term, Term::AshikhminFresnel | Term::CookTorrance)
}

/// x, dx/dq, g(x) and dg/dq for q = ln of the parameter.
pub(crate) fn rate(term: Term, q: f64) -> (f64, f64, f64, f64) {
    let p = q.exp();
    match term {
        Term::BlinnPhong => (p, p, p + 8.0, p),
        Term::Phong => (p, p, p + 2.0, p),
        Term::Ward | Term::WardDuer | Term::CookTorrance => {
            let x = 1.0 / (p * p);
            (x, -2.0 * x, x, -2.0 * x)
        }
        _ => (p, p, p + 1.0, p),
    }
}

/// The exponent of (n·h)^n with the curvature of the lobe at rate x: how fine a cell must be sampled.
pub(crate) fn sharpness(term: Term, x: f64) -> f64 {
    match term {
        Term::Phong => 4.0 * x,
        Term::Ward | Term::WardDuer | Term::CookTorrance => 2.0 * x,
        _ => x,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ray::Sample;
    use gonio_optics::Geometry;

    #[test]
    fn the_form_is_the_term() {
        let terms = [
            (Term::BlinnPhong, 80f64),
            (Term::Phong, 20.0),
            (Term::Ashikhmin, 120.0),
            (Term::AshikhminFresnel, 120.0),
            (Term::Ward, 0.2),
            (Term::WardDuer, 0.3),
            (Term::CookTorrance, 0.25),
        ];
        for (term, p) in terms {
            assert!(serves(term));
            let (x, dx, g, dg) = rate(term, p.ln());
            let (x2, _, g2, _) = rate(term, p.ln() + 1e-6);
            assert!(((x2 - x) / 1e-6 / dx - 1.0).abs() < 1e-4 && ((g2 - g) / 1e-6 / dg - 1.0).abs() < 1e-4);
            for (ti, to, phi) in [(0.0, 0.0, 0.0), (30.0, 41.0, 175.0), (70.0, 65.0, 180.0), (45.0, 60.0, 120.0)] {
                let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
                let ray = Sample::new(1.0, l, v).unwrap().ray(None);
                let want = term.value(&[p, 0.07, 0.0], &ray);
                let Some((u, k, m)) = at(term, &ray) else {
                    assert_eq!(want, 0.0);
                    continue;
                };
                let fresnel = if has_fresnel(term) { 0.07 + 0.93 * m } else { 1.0 };
                let got = g * k * (-x * u).exp() * fresnel;
                assert!((got / want - 1.0).abs() < 1e-11, "{term:?} {ti} {to} {phi}: {got} {want}");
            }
        }
    }
}
