//! Isochromatic lines in single precision, as look-ups take them: cosines in, cosines out, no trigonometric function.
//!
//! [`isoline`](crate::isoline()) goes through sines, and near 90° a cosine from a sine loses half its digits. With ε = cos θ' − cos θc the distance of a
//! refracted direction from the critical angle, `cos θc = √(1 − 1/n²)`,
//!
//! ```text
//! ε_l = l_z² / (n² (l'_z + cos θc))          l'_z = √(cos² θc + l_z²/n²)          ε_v likewise
//! p² = sin² θ_inc sin² θ_flake = ((ε_l − ε_v)/2)² + (l' × v')_z² / |s|²
//! cos θ1' − cos θc = (ε_l + ε_v)/2 − p = ((ε_l ε_v − (l' × v')_z² / |s|²) / ((ε_l + ε_v)/2 + p)
//! cos θ2' − cos θc = (ε_l + ε_v)/2 + p
//! cos² θ'ill = n² (cos θ1' − cos θc) (cos θ1' + cos θc)          cos² θ'det likewise
//! ```
//!
//! since θ1' and θ2' (Kirchner eqs. 5–7) share |s_xy| and s_z with the geometry. In-plane the cross product is 0 and the cosines come back as they were.
//! A negative cos² θ'ill is the critical angle met.

use crate::isoline::Method;

/// The in-plane equivalent of a geometry, by its cosines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IsolineSingle {
    /// cos θ'ill, outside.
    pub cos_ill: f32,
    /// cos θ'det, outside.
    pub cos_det: f32,
    /// φ' = 180°; else 0°. Where θ'det = 0 either is right.
    pub mirror_side: bool,
    /// The critical angle was met, so the method decided.
    pub limited: bool,
}

impl IsolineSingle {
    /// Both polar angles clipped at the largest measured one, given by its cosine.
    #[must_use]
    pub fn clipped_at(self, cos_largest: f32) -> Self {
        Self { cos_ill: self.cos_ill.max(cos_largest), cos_det: self.cos_det.max(cos_largest), ..self }
    }
}

/// In-plane equivalent of two unit directions outside a coat of `index` (ignored by [`Method::UnitIndex`]).
///
/// Directions below the horizon count as at the horizon. Exchanging them changes no bit.
#[must_use]
pub fn isoline_single(l: [f32; 3], v: [f32; 3], index: f32, method: Method) -> IsolineSingle {
    let index = if method == Method::UnitIndex { 1.0 } else { index };
    let inverse = 1.0 / index;
    let critical2 = 1.0 - inverse * inverse;
    let critical = critical2.max(0.0).sqrt();
    // l'_z and ε: the product in this order keeps a tiny cosine
    let refracted = |cos: f32| {
        let z = cos.max(0.0) * inverse;
        let inside = (critical2 + z * z).max(0.0).sqrt();
        (inside, z * (z / (inside + critical).max(f32::MIN_POSITIVE)))
    };
    let ((lz, el), (vz, ev)) = (refracted(l[2]), refracted(v[2]));
    let (lx, ly, vx, vy) = (l[0] * inverse, l[1] * inverse, v[0] * inverse, v[1] * inverse);
    let (sx, sy, sz) = (lx + vx, ly + vy, lz + vz);
    let (dx, dy, dz) = (lx - vx, ly - vy, el - ev);
    let flat = sx * sx + sy * sy;
    let sum2 = flat + sz * sz;
    let cross = lx * vy - ly * vx;
    // opposite grazing directions without a coat have no sum: their flake lies flat
    let out_of_plane = cross * cross / sum2.max(f32::MIN_POSITIVE);
    let (half, product) = (0.5 * (el + ev), (0.25 * dz * dz + out_of_plane).sqrt());
    let far = half + product;
    let near = if far > 0.0 { (el * ev - out_of_plane) / far } else { 0.0 };
    let squared = |e: f32| index * index * e * (e + 2.0 * critical);
    let (ill2, det2) = (squared(near), squared(far));
    // sin θ1' sin θ2' = sin² θ_inc − sin² θ_flake
    let mirror = 0.25 * (dx * dx + dy * dy + dz * dz) * sum2 >= flat;
    let mut out = IsolineSingle {
        // without a coat cos θc is 0 and the product of two negative factors no cosine
        cos_ill: if near > 0.0 { ill2.clamp(0.0, 1.0).sqrt() } else { 0.0 },
        cos_det: det2.clamp(0.0, 1.0).sqrt(),
        mirror_side: mirror,
        limited: near < -ROUNDING,
    };
    let way = match method {
        Method::MapVector => 1.0,
        Method::MapVectorParallel => -1.0,
        Method::Clip | Method::UnitIndex => return out,
    };
    if out.limited {
        // |c| = n sin θ1' − 1, from n² sin² θ1' = 1 − cos² θ'ill
        let step = -ill2 / (1.0 + (1.0 - ill2).sqrt());
        let w = ((1.0 - out.cos_det).copysign(if mirror { 1.0 } else { -1.0 }) + way * step).clamp(-1.0, 1.0);
        out.cos_det = 1.0 - w.abs();
        out.mirror_side = w >= 0.0;
    }
    out
}

/// How far cos θ1' may fall short of the critical angle's before it counts as met: rounding of the cross product.
const ROUNDING: f32 = 1e-7;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Geometry, Vec3, isoline};
    use proptest::prelude::*;

    fn single(d: Vec3) -> [f32; 3] {
        d.to_array().map(|x| x as f32)
    }

    /// Largest difference of a cosine from that in double precision, at the very directions that single precision holds.
    fn off(ti: f64, to: f64, phi: f64, method: Method) -> (f64, crate::Isoline) {
        let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
        let a = isoline_single(single(l), single(v), 1.5, method);
        let b = isoline(l, v, 1.5, method);
        let ill = (f64::from(a.cos_ill) - b.theta_ill.cos()).abs();
        let signed = |cos: f64, mirror: bool| (1.0 - cos).copysign(if mirror { 1.0 } else { -1.0 });
        let det = (signed(f64::from(a.cos_det), a.mirror_side)
            - signed(b.theta_det.cos(), b.phi_det.degrees() > 90.0))
        .abs();
        (ill.max(det), b)
    }

    proptest! {
        #[test]
        fn cosines_are_those_of_double_precision(ti in 0.0..89.9f64, to in 0.0..89.9f64, phi in 0.0..180.0f64) {
            for (_, method) in Method::ALL {
                let (off, exact) = off(ti, to, phi, method);
                // of a cosine near 0 its square is what single precision holds
                let bound = 1e-5f64.max(2e-7 / exact.theta_ill.cos().max(4e-4));
                prop_assert!(off <= bound, "{method}: {off:e} {exact:?}");
            }
        }

        #[test]
        fn in_plane_geometries_come_back_as_they_were(ti in 0.0..90.0f64, to in 0.0..90.0f64, mirror in any::<bool>()) {
            let (l, v) = Geometry::from_degrees(ti, to, if mirror { 180.0 } else { 0.0 }).directions();
            let i = isoline_single(single(l), single(v), 1.5, Method::Clip);
            let (high, low) = (ti.max(to).to_radians().cos(), ti.min(to).to_radians().cos());
            prop_assert!(!i.limited);
            prop_assert!((f64::from(i.cos_ill) - high).abs() < 3e-7 && (f64::from(i.cos_det) - low).abs() < 3e-7, "{i:?} {high} {low}");
        }

        #[test]
        fn exchanging_light_and_view_changes_no_bit(ti in 0.0..=90.0f64, to in 0.0..=90.0f64, phi in 0.0..=180.0f64) {
            let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
            for (_, method) in Method::ALL {
                prop_assert_eq!(
                    isoline_single(single(l), single(v), 1.5, method),
                    isoline_single(single(v), single(l), 1.5, method)
                );
            }
        }
    }

    #[test]
    fn extreme_geometries_have_an_answer() {
        let edges = [0.0, 1e-12, 1e-6, 41.810_315, 45.0, 89.999_999, 90.0];
        for ti in edges {
            for to in edges {
                for phi in [0.0, 1e-9, 90.0, 179.999_999, 180.0] {
                    let (l, v) = Geometry::from_degrees(ti, to, phi).directions();
                    for (_, method) in Method::ALL {
                        for index in [1.0, 1.5, 4.0] {
                            let i = isoline_single(single(l), single(v), index, method);
                            assert!(
                                (0.0..=1.0).contains(&i.cos_ill) && (0.0..=1.0).contains(&i.cos_det),
                                "{i:?}"
                            );
                        }
                    }
                }
            }
        }
    }
}
