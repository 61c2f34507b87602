//! Isochromatic lines: the in-plane geometry that shows the same flakes as a given one (Kirchner eqs. 5–7, fixes A, B, C).
//!
//! Inside the coat the in-plane equivalent is `θ1' = θ_inc + θ_flake`, `θ2' = θ_inc − θ_flake`; outside
//! `sin θ'ill = n sin θ1'`, `sin θ'det = n |sin θ2'|`, with φ' = 180° (mirror side) for θ2' ≥ 0 and 0° otherwise. Only θ'ill can pass
//! 90°; a [`Method`] says what happens then. Sines of the sums follow from |s|, |d|, s_z and |s_xy| without inverse trigonometry.

use std::str::FromStr;

use crate::{
    Angle, Geometry, Vec3,
    edge::safe_asin,
    flake::{FlakeAngles, FlakeVectors},
};

/// How far `n sin θ1'` may exceed 1 before the critical angle counts as met: rounding of the square roots that lead to it.
const ROUNDING: f64 = 1e-13;

/// What to do where the critical angle is met (`n sin θ1' > 1`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Method {
    /// A: θ'ill is taken as 90° (real part of Kirchner eq. 10), θ'det stays. [`Isoline::clipped_at`] clips at a smaller measured angle.
    #[default]
    Clip,
    /// B: the walk in the colour map, in the paper's words: perpendicular to the gloss line.
    ///
    /// With `c = 1 − n sin θ1'` and `w = ±(1 − cos θ'det)` (+ on the mirror side): `w → w + |c|` at θ'ill = 90°.
    MapVector,
    /// B∥: the same walk in the direction that keeps the aspecular angle, which is the paper's reason: `w → w − |c|`. Crossing w = 0 changes φ'.
    MapVectorParallel,
    /// C: no coat at all, n = 1. The in-plane light may then stand below the horizon (θ1' > 90°): it is taken at 90° and reported as limited.
    UnitIndex,
}

/// A name that is no [`Method`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown isoline method \"{found}\": use clip, map-vector, map-vector-parallel or unit-index")]
pub struct UnknownMethod {
    /// The name given.
    pub found: String,
}

impl Method {
    /// All methods with their names on the command line.
    pub const ALL: [(&'static str, Self); 4] = [
        ("clip", Self::Clip),
        ("map-vector", Self::MapVector),
        ("map-vector-parallel", Self::MapVectorParallel),
        ("unit-index", Self::UnitIndex),
    ];

    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Clip => "clip",
            Self::MapVector => "map-vector",
            Self::MapVectorParallel => "map-vector-parallel",
            Self::UnitIndex => "unit-index",
        }
    }
}

impl FromStr for Method {
    type Err = UnknownMethod;
    fn from_str(s: &str) -> Result<Self, UnknownMethod> {
        Self::ALL
            .iter()
            .find(|(name, _)| *name == s)
            .map(|&(_, m)| m)
            .ok_or_else(|| UnknownMethod { found: s.to_owned() })
    }
}

impl std::fmt::Display for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// The in-plane equivalent of a geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isoline {
    /// What the flake sees, inside the coat (inside nothing for [`Method::UnitIndex`]).
    pub flake: FlakeAngles,
    /// θ'ill, outside.
    pub theta_ill: Angle,
    /// θ'det ≥ 0, outside.
    pub theta_det: Angle,
    /// φ': 180° on the mirror side, 0° on the light's side. Where θ'det = 0 either is right; 180° is given.
    pub phi_det: Angle,
    /// The critical angle was met, so the method decided.
    pub limited: bool,
}

impl Isoline {
    /// The in-plane geometry as such.
    #[must_use]
    pub const fn geometry(self) -> Geometry {
        Geometry { theta_i: self.theta_ill, theta_o: self.theta_det, phi: self.phi_det }
    }

    /// Both polar angles clipped at the largest measured one (75° for a table that ends there).
    #[must_use]
    pub const fn clipped_at(self, largest: Angle) -> Self {
        Self { theta_ill: self.theta_ill.min(largest), theta_det: self.theta_det.min(largest), ..self }
    }
}

/// In-plane equivalent of two unit directions outside a coat of `index` (ignored by [`Method::UnitIndex`]).
///
/// Exchanging `l` and `v` gives the same answer: the two in-plane geometries of an isoline are reciprocal.
#[must_use]
pub fn isoline(l: Vec3, v: Vec3, index: f64, method: Method) -> Isoline {
    let index = if method == Method::UnitIndex { 1.0 } else { index };
    let f = FlakeVectors::new(l, v, index);
    let sum = index * f.sin_sum();
    let difference = index * f.sin_difference();
    let limited = sum > 1.0 + ROUNDING || f.cos_sum() < 0.0;
    let (cos_ill, cos_det) = outside_cosines(l, v, index);
    let mut out = Isoline {
        flake: f.angles(),
        theta_ill: if limited { Angle::RIGHT } else { Angle::from_radians(sum.atan2(cos_ill)) },
        theta_det: Angle::from_radians(difference.abs().atan2(cos_det)),
        phi_det: side(difference),
        limited,
    };
    let step = match method {
        Method::MapVector => (sum - 1.0).max(0.0),
        Method::MapVectorParallel => -(sum - 1.0).max(0.0),
        Method::Clip | Method::UnitIndex => 0.0,
    };
    if limited && step != 0.0 {
        // w = ±(1 − cos θ'det), from the half angle so that small angles keep their digits
        let half = (out.theta_det * 0.5).sin();
        let w = ((2.0 * half * half).copysign(difference) + step).clamp(-1.0, 1.0);
        out.theta_det = Angle::from_radians(2.0 * safe_asin((0.5 * w.abs()).sqrt()));
        out.phi_det = side(w);
    }
    out
}

/// cos θ'ill (0 where there is none) and cos θ'det outside, not by way of sines that are nearly 1: the equations of [`crate::isoline_single`].
fn outside_cosines(l: Vec3, v: Vec3, index: f64) -> (f64, f64) {
    let critical2 = (1.0 - 1.0 / (index * index)).max(0.0);
    let critical = critical2.sqrt();
    let refracted = |cos: f64| {
        let z = cos.max(0.0) / index;
        let inside = (critical2 + z * z).sqrt();
        (inside, z * (z / (inside + critical).max(f64::MIN_POSITIVE)))
    };
    let ((lz, el), (vz, ev)) = (refracted(l.z), refracted(v.z));
    let (sx, sy, sz) = ((l.x + v.x) / index, (l.y + v.y) / index, lz + vz);
    let cross = (l.x * v.y - l.y * v.x) / (index * index);
    let out_of_plane = cross * cross / (sx * sx + sy * sy + sz * sz).max(f64::MIN_POSITIVE);
    let far = 0.5 * (el + ev) + (0.25 * (el - ev) * (el - ev) + out_of_plane).sqrt();
    let near = if far > 0.0 { ((el * ev - out_of_plane) / far).max(0.0) } else { 0.0 };
    let cos = |e: f64| index * (e * (e + 2.0 * critical)).sqrt();
    (cos(near), cos(far))
}

/// φ' for a signed θ2'.
fn side(signed: f64) -> Angle {
    if signed < 0.0 { Angle::ZERO } else { Angle::STRAIGHT }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(ti: f64, to: f64, phi: f64, method: Method) -> Isoline {
        let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
        isoline(l, v, 1.5, method)
    }

    #[test]
    fn names_are_read_back() {
        for (name, m) in Method::ALL {
            assert_eq!((name.parse::<Method>().unwrap(), m.to_string().as_str()), (m, name));
        }
        assert!("b".parse::<Method>().unwrap_err().to_string().contains("map-vector-parallel"));
    }

    #[test]
    fn the_two_walks_go_opposite_ways_along_the_edge_of_the_map() {
        let (a, b, p) = (
            at(75.0, 75.0, 130.0, Method::Clip),
            at(75.0, 75.0, 130.0, Method::MapVector),
            at(75.0, 75.0, 130.0, Method::MapVectorParallel),
        );
        assert!(a.limited && a.phi_det == Angle::STRAIGHT);
        let signed =
            |i: &Isoline| (1.0 - i.theta_det.cos()) * if i.phi_det == Angle::ZERO { -1.0 } else { 1.0 };
        assert!(signed(&b) > signed(&a) && signed(&a) > signed(&p));
        // same length both ways
        assert!((signed(&b) + signed(&p) - 2.0 * signed(&a)).abs() < 1e-12);
    }

    #[test]
    fn a_table_that_ends_at_75_degrees_clips_there() {
        let c = at(75.0, 75.0, 90.0, Method::Clip).clipped_at(Angle::from_degrees(75.0));
        assert!((c.geometry().theta_i.degrees() - 75.0).abs() < 1e-12 && c.limited);
    }

    proptest! {
        #[test]
        fn in_plane_geometries_are_their_own_equivalents_up_to_reciprocity(ti in 0.0..89.9f64, to in 0.0..89.9f64, mirror in any::<bool>()) {
            let i = at(ti, to, if mirror { 180.0 } else { 0.0 }, Method::Clip);
            let (hi, lo) = (ti.max(to), ti.min(to));
            prop_assert!(!i.limited);
            prop_assert!((i.theta_ill.degrees() - hi).abs() < 1e-9, "{} {hi}", i.theta_ill);
            prop_assert!((i.theta_det.degrees() - lo).abs() < 1e-9, "{} {lo}", i.theta_det);
        }

        #[test]
        fn exchanging_light_and_view_changes_nothing(ti in 0.0..90.0f64, to in 0.0..90.0f64, phi in 0.0..180.0f64) {
            for (_, m) in Method::ALL {
                let (a, b) = (at(ti, to, phi, m), at(to, ti, phi, m));
                prop_assert!((a.theta_ill.cos() - b.theta_ill.cos()).abs() < 1e-7);
                let signed = |i: &Isoline| i.theta_det.sin() * -i.phi_det.cos();
                prop_assert!((signed(&a) - signed(&b)).abs() < 1e-9);
            }
        }

        #[test]
        fn the_equivalent_sees_the_same_flake(ti in 0.0..89.0f64, to in 0.0..89.0f64, phi in 0.0..180.0f64) {
            let i = at(ti, to, phi, Method::Clip);
            if !i.limited && i.theta_ill.degrees() < 89.9 {
                let (l, v) = i.geometry().directions();
                let again = crate::flake::flake_angles(l, v, 1.5);
                prop_assert!((again.theta_inc - i.flake.theta_inc).abs().degrees() < 1e-9);
                prop_assert!((again.theta_flake - i.flake.theta_flake).abs().degrees() < 1e-9);
            }
        }

        #[test]
        fn every_geometry_has_an_answer_inside_the_hemisphere(ti in 0.0..=90.0f64, to in 0.0..=90.0f64, phi in 0.0..=180.0f64) {
            for (_, m) in Method::ALL {
                let i = at(ti, to, phi, m);
                for a in [i.theta_ill, i.theta_det] {
                    prop_assert!((0.0..=90.0 + 1e-12).contains(&a.degrees()), "{m}: {a}");
                }
            }
        }
    }
}
