//! How much of a pixel's footprint on the sample the lamp's spot covers.
//!
//! A pixel sees the pupil's image at F1, a disc of radius ρ across the line of sight, drawn out to ρ/cos θo on the sample. The spot is an
//! ellipse: radius R across the plane of incidence, R/cos θi within. Along the azimuth of view the spot reaches
//! `s = R / sqrt(sin² φ + cos² θi cos² φ)`; a uniform disc drawn out to q = ρ/cos θo lies within ±s by
//! `(2/π)(asin u + u sqrt(1 − u²))`, u = s/q. Across it (ρ against R) it is always covered.

use gonio_optics::Vec3;

/// Share of the footprint within the spot, 0…1. `view` is a unit direction in the sample frame.
#[must_use]
pub fn lit_share(footprint_mm: f64, spot_mm: f64, cos_i: f64, view: Vec3) -> f64 {
    let across2 = view.x * view.x + view.y * view.y;
    if view.z <= 0.0 {
        return 0.0;
    }
    let (c2, s2) =
        if across2 > 0.0 { (view.x * view.x / across2, view.y * view.y / across2) } else { (1.0, 0.0) };
    let reach = spot_mm / (s2 + cos_i * cos_i * c2).sqrt().max(1e-6);
    let u = reach * view.z / footprint_mm.max(1e-9);
    if u >= 1.0 {
        return 1.0;
    }
    std::f64::consts::FRAC_2_PI * (u.asin() + u * (1.0 - u * u).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::Angle;

    #[test]
    fn steep_views_are_over_filled_and_grazing_ones_fade() {
        let at = |deg| {
            lit_share(0.42, 3.0, 1.0, Vec3::from_polar(Angle::from_degrees(deg), Angle::from_degrees(90.0)))
        };
        assert!(at(0.0) == 1.0 && at(76.0) == 1.0);
        assert!(at(85.0) < 1.0 && at(89.0) < at(85.0) && at(90.0) < 1e-6);
    }
}
