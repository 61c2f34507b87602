//! The terms models are made of: one function of the directions each, linear in its colour, with up to three nonlinear parameters.
//!
//! The formulas are those of [`gonio_brdf::models`], held to them by a test, written for numbers that carry derivatives.

use std::f64::consts::{FRAC_1_PI, PI, TAU};

use crate::{number::Number, ray::Ray};

/// A term; the parameters are listed in the order in which [`Term::value`] takes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Term {
    /// 1/π.
    Lambert,
    /// 28/(23π)(1 − r0)(1 − (1 − n·l/2)^5)(1 − (1 − n·v/2)^5): r0.
    AshikhminDiffuse,
    /// Oren and Nayar's diffuser: σ in degrees.
    OrenNayar,
    /// Phong's lobe: exponent.
    Phong,
    /// Blinn's lobe: exponent.
    BlinnPhong,
    /// Ashikhmin–Shirley's lobe without Fresnel factor: exponent.
    Ashikhmin,
    /// The same with Schlick's factor: exponent, r0.
    AshikhminFresnel,
    /// The anisotropic one: exponents along x and y, r0.
    AshikhminAnisotropic,
    /// Ward's lobe: α.
    Ward,
    /// Ward's lobe in Dür's normalisation: α.
    WardDuer,
    /// Cook and Torrance's lobe: α, r0.
    CookTorrance,
    /// GGX lobe: α, r0.
    Ggx,
    /// Lafortune's lobe: exponent and lean ψ in degrees, (Cxy, Cz) = (−sin ψ, cos ψ)/max(|sin ψ|, cos ψ).
    Lafortune,
}

impl Term {
    /// Value for colour 1, seen through the coat of the ray.
    #[inline]
    pub(crate) fn value<T: Number>(self, x: &[T; 3], r: &Ray<T>) -> T {
        r.throughput
            * match self {
                Self::Lambert => T::constant(FRAC_1_PI),
                Self::AshikhminDiffuse => ashikhmin_diffuse(x[0], r),
                Self::OrenNayar => oren_nayar(x[0], r),
                Self::Phong => phong(x[0], r),
                Self::BlinnPhong => cosine_power(r.sin2, x[0]) * x[0].plus(8.0).times(1.0 / (8.0 * PI)),
                Self::Ashikhmin => ashikhmin(cosine_power(r.sin2, x[0]), x[0].plus(1.0), r),
                Self::AshikhminFresnel => {
                    ashikhmin(cosine_power(r.sin2, x[0]), x[0].plus(1.0), r) * schlick(x[1], r)
                }
                Self::AshikhminAnisotropic => {
                    let along = x[0].times(r.share_x) + x[1].times(1.0 - r.share_x);
                    let norm = (x[0].plus(1.0) * x[1].plus(1.0)).sqrt();
                    ashikhmin(cosine_power(r.sin2, along), norm, r) * schlick(x[2], r)
                }
                Self::Ward => gaussian(x[0], r) / (r.cos[0] * r.cos[1]).sqrt(),
                Self::WardDuer => gaussian(x[0], r) / (r.cos[0] * r.cos[1]),
                Self::CookTorrance => cook_torrance(x[0], r) * schlick(x[1], r),
                Self::Ggx => ggx(x[0], r) * schlick(x[1], r),
                Self::Lafortune => lafortune(x[0], x[1], r),
            }
    }

    /// Exponent of the (n·h)^n with the curvature of this lobe at its peak; 0 for a diffuse term.
    pub(crate) fn sharpness(self, x: &[f64; 3]) -> f64 {
        match self {
            Self::Lambert | Self::AshikhminDiffuse | Self::OrenNayar => 0.0,
            Self::BlinnPhong | Self::Ashikhmin | Self::AshikhminFresnel => x[0],
            Self::AshikhminAnisotropic => x[0].max(x[1]),
            Self::Phong | Self::Lafortune => 4.0 * x[0],
            Self::Ward | Self::WardDuer | Self::CookTorrance => 2.0 / (x[0] * x[0]),
            Self::Ggx => 4.0 / (x[0] * x[0]),
        }
    }
}

/// Schlick's factor r0 + (1 − r0)(1 − h·v)^5.
fn schlick<T: Number>(r0: T, r: &Ray<T>) -> T {
    r0 + (T::constant(1.0) - r0) * r.rise
}

/// cos^n from sin²; 0 at 90°.
fn cosine_power<T: Number>(sin2: T, exponent: T) -> T {
    if sin2.value() >= 1.0 {
        return T::constant(if exponent.value() == 0.0 { 1.0 } else { 0.0 });
    }
    (exponent * (-sin2).ln_1p()).times(0.5).exp()
}

fn ashikhmin_diffuse<T: Number>(r0: T, r: &Ray<T>) -> T {
    let side = |c: T| {
        let m = T::constant(1.0) - c.times(0.5);
        T::constant(1.0) - m.squared().squared() * m
    };
    (side(r.cos[0]) * side(r.cos[1]) * (T::constant(1.0) - r0)).times(28.0 / (23.0 * PI))
}

fn oren_nayar<T: Number>(sigma_deg: T, r: &Ray<T>) -> T {
    let s2 = sigma_deg.times(PI / 180.0).squared();
    let a = T::constant(1.0) - (s2 / s2.plus(0.33)).times(0.5);
    let b = (s2 / s2.plus(0.09)).times(0.45);
    (a + b * r.tangent.at_least(0.0) / r.cos[0].larger(r.cos[1])).times(FRAC_1_PI)
}

fn phong<T: Number>(exponent: T, r: &Ray<T>) -> T {
    if r.below.value() >= 1.0 {
        return T::constant(0.0);
    }
    let sin2 = r.below * (T::constant(2.0) - r.below);
    cosine_power(sin2, exponent) * exponent.plus(2.0).times(1.0 / TAU)
}

/// `norm/(8π) (n·h)^n / ((h·v) max(n·l, n·v))`, the power handed in.
fn ashikhmin<T: Number>(power: T, norm: T, r: &Ray<T>) -> T {
    norm * power / (r.hv * r.cos[0].larger(r.cos[1])).times(8.0 * PI)
}

/// Ward's `exp(−tan² θh/α²)/(4π α²)`.
fn gaussian<T: Number>(alpha: T, r: &Ray<T>) -> T {
    let c2 = T::constant(1.0) - r.sin2;
    if c2.value() <= 0.0 {
        return T::constant(0.0);
    }
    let a2 = alpha.squared();
    (-(r.sin2 / (a2 * c2))).exp() / a2.times(4.0 * PI)
}

/// `D G/(4 (n·l)(n·v))`, Beckmann and V-cavities.
fn cook_torrance<T: Number>(alpha: T, r: &Ray<T>) -> T {
    let c2 = T::constant(1.0) - r.sin2;
    if c2.value() <= 0.0 {
        return T::constant(0.0);
    }
    let a2 = alpha.squared();
    let d = (-(r.sin2 / (a2 * c2))).exp() / (a2 * c2.squared()).times(PI);
    let [l, v] = r.cos;
    let g = (T::constant(1.0) / (l * v)).smaller(c2.sqrt().times(2.0) / (r.hv * l.larger(v)));
    // the exponential is gone long before 1/c⁴ matters
    if d.value() > 0.0 { (d * g).times(0.25) } else { T::constant(0.0) }
}

/// `D G/(4 (n·l)(n·v))`, Trowbridge–Reitz and Smith's correlated masking.
fn ggx<T: Number>(alpha: T, r: &Ray<T>) -> T {
    let a2 = alpha.squared();
    let width = a2 * (T::constant(1.0) - r.sin2) + r.sin2;
    let d = a2 / width.squared().times(PI);
    let root = |c: T| {
        let c2 = c.squared();
        (a2 * (T::constant(1.0) - c2).at_least(0.0) + c2).sqrt()
    };
    let [l, v] = r.cos;
    d.times(0.5) / (v * root(l) + l * root(v))
}

/// Cxy and Cz of a lean ψ.
pub(crate) fn lafortune_weights<T: Number>(lean_deg: T) -> (T, T) {
    let (s, c) = lean_deg.times(PI / 180.0).sin_cos();
    let size = if s.value() < 0.0 { -s } else { s };
    // cos 90° rounds to 6e-17, which is 0
    let c = c.at_least(0.0);
    let largest = size.larger(c);
    (-s / largest, c / largest)
}

fn lafortune<T: Number>(exponent: T, lean_deg: T, r: &Ray<T>) -> T {
    let (cxy, cz) = lafortune_weights(lean_deg);
    let dot = cxy * r.tangent + cz * r.cos[0] * r.cos[1];
    if dot.value() <= 0.0 {
        return T::constant(0.0);
    }
    (exponent * dot.smaller(T::constant(1.0)).ln()).exp() * exponent.plus(2.0).times(1.0 / TAU)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::number::{Dual, SLOTS};
    use crate::ray::Sample;
    use gonio_brdf::{Brdf, ModelFile};
    use gonio_optics::Geometry;

    /// Each term with parameters and the model file that it is the whole or the lobe of.
    fn all() -> Vec<(Term, [f64; 3], String)> {
        let lobe = |model: &str, rest: &str| {
            format!(r#"{{"model":"{model}","diffuse":[0,0,0],"specular":[1,1,1],{rest}}}"#)
        };
        let lobes = |model: &str, rest: &str| {
            format!(r#"{{"model":"{model}","diffuse":[0,0,0],"lobes":[{{"specular":[1,1,1],{rest}}}]}}"#)
        };
        let (cxy, cz) = lafortune_weights(57.0f64);
        vec![
            (Term::Lambert, [0.0; 3], r#"{"model":"lambert","diffuse":[1,1,1]}"#.into()),
            (
                Term::AshikhminDiffuse,
                [0.1, 0.0, 0.0],
                r#"{"model":"ashikhmin-shirley","diffuse":[1,1,1],"specular":[0,0,0],"exponent":9,"r0":0.1}"#
                    .into(),
            ),
            (
                Term::OrenNayar,
                [33.0, 0.0, 0.0],
                r#"{"model":"oren-nayar","diffuse":[1,1,1],"sigma_deg":33}"#.into(),
            ),
            (Term::Phong, [21.0, 0.0, 0.0], lobe("phong", r#""exponent":21"#)),
            (Term::BlinnPhong, [80.0, 0.0, 0.0], lobe("blinn-phong", r#""exponent":80"#)),
            (Term::Ashikhmin, [120.0, 0.0, 0.0], lobe("ashikhmin-shirley-simplified", r#""exponent":120"#)),
            (
                Term::AshikhminFresnel,
                [120.0, 0.07, 0.0],
                lobe("lambert-ashikhmin-shirley", r#""exponent":120,"r0":0.07"#),
            ),
            (
                Term::AshikhminAnisotropic,
                [120.0, 12.0, 0.07],
                lobe("ashikhmin-shirley-anisotropic", r#""exponent_u":120,"exponent_v":12,"r0":0.07"#),
            ),
            (Term::Ward, [0.2, 0.0, 0.0], lobe("ward", r#""alpha":0.2"#)),
            (Term::WardDuer, [0.2, 0.0, 0.0], lobe("ward-duer", r#""alpha":0.2"#)),
            (Term::CookTorrance, [0.3, 0.1, 0.0], lobes("cook-torrance", r#""alpha":0.3,"r0":0.1"#)),
            (Term::Ggx, [0.3, 0.1, 0.0], lobes("ggx", r#""alpha":0.3,"r0":0.1"#)),
            (
                Term::Lafortune,
                [17.0, 57.0, 0.0],
                lobes("lafortune", &format!(r#""cxy":{cxy},"cz":{cz},"exponent":17"#)),
            ),
        ]
    }

    fn geometries() -> Vec<Geometry> {
        let angles = [
            (0.0, 0.0, 0.0),
            (30.0, 31.0, 179.0),
            (70.0, 65.0, 180.0),
            (45.0, 80.0, 20.0),
            (89.0, 88.0, 170.0),
            (5.0, 20.0, 90.0),
        ];
        angles.iter().map(|&(a, b, c)| Geometry::from_degrees(a, b, c)).collect()
    }

    #[test]
    fn terms_are_the_models_of_the_files_bare_and_under_a_coat() {
        for (term, x, text) in all() {
            let bare = ModelFile::from_json(&text).unwrap();
            let coated = ModelFile::from_json(&text.replacen('{', r#"{"coat":{"index":1.5},"#, 1)).unwrap();
            for g in geometries() {
                let (l, v) = g.directions();
                for (file, index) in [(&bare, None), (&coated, Some(1.5))] {
                    let got = term.value(&x, &Sample::new(1.0, l, v).unwrap().ray(index));
                    let want = file.eval(l, v)[0];
                    assert!(
                        (got - want).abs() <= 1e-11 * want.abs() + 1e-300,
                        "{term:?} {g:?} {index:?}: {got} {want}"
                    );
                }
            }
        }
    }

    #[test]
    fn derivatives_agree_with_differences_the_coats_index_included() {
        for (term, x, _) in all() {
            for g in geometries() {
                let (l, v) = g.directions();
                let sample = Sample::new(1.0, l, v).unwrap();
                let dual = term.value(
                    &[0, 1, 2].map(|s| Dual::variable(x[s], s)),
                    &sample.ray(Some(Dual::variable(1.5, SLOTS - 1))),
                );
                let plain = |slot: usize, by: f64| {
                    let mut at = [x[0], x[1], x[2], 1.5];
                    at[slot] += by;
                    term.value(&[at[0], at[1], at[2]], &sample.ray(Some(at[3])))
                };
                for (slot, size) in [x[0], x[1], x[2], 1.5].into_iter().enumerate() {
                    if size == 0.0 {
                        continue;
                    }
                    let h = 1e-5 * size;
                    // central differences of two steps, extrapolated
                    let at = |h: f64| (plain(slot, h) - plain(slot, -h)) / (2.0 * h);
                    let want = (4.0 * at(0.5 * h) - at(h)) / 3.0;
                    let scale = plain(slot, 0.0).abs() / size;
                    assert!(
                        (dual.d[slot] - want).abs() <= 1e-7 * (want.abs() + scale) + 1e-300,
                        "{term:?} {g:?} slot {slot}: {} {want}",
                        dual.d[slot]
                    );
                }
            }
        }
    }
}
