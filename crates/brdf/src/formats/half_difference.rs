//! Rusinkiewicz' half and difference directions, by which MERL tables and the networks are addressed.

use gonio_optics::Vec3;

/// Half direction turned to φh = 0, and the light seen from it.
///
/// `h = (l + v)/|l + v|`, turned about the normal into the xz plane: `(sin θh, 0, cos θh)`; `d` is the light turned likewise and then by −θh about
/// y. Opposite grazing directions have no sum; the normal stands for it.
pub(super) fn half_difference(light: Vec3, view: Vec3) -> (Vec3, Vec3) {
    let sum = light + view;
    let h = if sum.norm() > 1e-12 { sum.normalized() } else { Vec3::Z };
    let sin = h.x.hypot(h.y);
    let (cos_phi, sin_phi) = if sin > 0.0 { (h.x / sin, h.y / sin) } else { (1.0, 0.0) };
    let turned =
        Vec3::new(cos_phi * light.x + sin_phi * light.y, cos_phi * light.y - sin_phi * light.x, light.z);
    let d = Vec3::new(h.z * turned.x - sin * turned.z, turned.y, sin * turned.x + h.z * turned.z);
    (Vec3::new(sin, 0.0, h.z), d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::Geometry;

    #[test]
    fn mirror_pairs_have_their_half_direction_at_the_normal() {
        let (l, v) = Geometry::from_degrees(35.0, 35.0, 180.0).directions();
        let (h, d) = half_difference(l, v);
        assert!((h - Vec3::Z).norm() < 1e-15);
        assert!((d.z.acos().to_degrees() - 35.0).abs() < 1e-9);
    }

    #[test]
    fn swapping_light_and_view_turns_the_difference_by_half_a_turn() {
        let (l, v) = Geometry::from_degrees(35.0, 60.0, 70.0).directions();
        let ((h, d), (k, e)) = (half_difference(l, v), half_difference(v, l));
        assert!((h - k).norm() < 1e-14 && (d - Vec3::new(-e.x, -e.y, e.z)).norm() < 1e-14);
    }
}
