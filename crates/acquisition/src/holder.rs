//! What the holder hides at a pose: disc, body, crank and shaft as fat cylinders around line segments.
//!
//! A pixel is lost where the way from the sample to its mirror point, or on from there to the camera's pupil, passes a part.
//! Parts are grown by a margin for the sizes of pupil, pixel and spot; the disc by the offset of the sample from the
//! spin axis as well, so that the same mask serves every spin.

use gonio_instrument::Description;
use gonio_optics::{Angle, Rotation, Vec3};

use crate::optics::Optics;

/// A right cylinder between two points of its axis.
#[derive(Clone, Copy, Debug)]
struct Cylinder {
    from: Vec3,
    axis: Vec3,
    length: f64,
    radius: f64,
}

impl Cylinder {
    fn between(from: Vec3, to: Vec3, radius: f64) -> Self {
        Self { from, axis: (to - from).normalized(), length: (to - from).norm(), radius }
    }

    /// Whether the segment p + t d, 0 ≤ t ≤ 1, passes through.
    fn hit(&self, p: Vec3, d: Vec3) -> bool {
        let o = p - self.from;
        let (oz, dz) = (o.dot(self.axis), d.dot(self.axis));
        // the part of the segment between the planes of the ends
        let (mut t0, mut t1) = (0.0f64, 1.0f64);
        if dz.abs() < 1e-12 {
            if oz < 0.0 || oz > self.length {
                return false;
            }
        } else {
            let (a, b) = (-oz / dz, (self.length - oz) / dz);
            t0 = t0.max(a.min(b));
            t1 = t1.min(a.max(b));
            if t0 > t1 {
                return false;
            }
        }
        // nearest approach to the axis within it
        let (op, dp) = (o - self.axis * oz, d - self.axis * dz);
        let dd = dp.norm_squared();
        let t = if dd > 0.0 { (-op.dot(dp) / dd).clamp(t0, t1) } else { t0 };
        (op + dp * t).norm_squared() < self.radius * self.radius
    }
}

/// Standard uncertainty of the mirror's place against the holder, mm: directions hardly depend on it, shadows do.
fn place_uncertainty_mm(description: &Description) -> f64 {
    let record = description.calibration_record.iter();
    record
        .flat_map(|r| &r.parameters)
        .filter(|p| p.name.starts_with("mirror_shift"))
        .map(|p| p.sigma)
        .fold(0.0, f64::max)
}

/// The holder at one pose.
#[derive(Clone, Debug)]
pub struct Holder {
    /// Parts that the sample can be seen past: not the disc and what lies straight behind it.
    parts: Vec<Cylinder>,
    /// Radius around F1 within which all but the shaft lie, mm.
    reach: f64,
    shaft: Cylinder,
    pupil: Vec3,
}

impl Holder {
    /// The holder of a description at a tilt read back.
    #[must_use]
    pub fn new(description: &Description, optics: &Optics, tilt_read_back: Angle) -> Self {
        let h = &description.holder;
        let n = optics.normal(tilt_read_back);
        // the shaft turns with the tilt axis that carries it
        let (nominal, found) = (h.tilt_axis(), optics.tilt_axis());
        let across = nominal.cross(found);
        let lean = if across.norm() > 0.0 {
            Rotation::from_vector(across.normalized() * nominal.angle_to(found).radians())
        } else {
            Rotation::IDENTITY
        };
        let shaft_axis = lean.apply(Vec3::from(h.shaft.direction).normalized());
        let camera = &description.camera;
        // pupil radius, a pixel at the distance of the sample, and what a calibration leaves open of where mirror and camera stand together
        let margin = 0.5 * camera.pupil_diameter_mm
            + 2.0 * place_uncertainty_mm(description)
            + camera.pitch_um * 1e-3 / camera.f_mm * 2.0 * description.mirror.c_mm();
        let behind = |depth: f64| n * -depth;
        // the sample surface itself hides nothing above the horizon: start a hair below it
        let disc = Cylinder::between(
            behind(0.05),
            behind(h.disc_thickness_mm + margin),
            h.disc_radius_mm + h.spin_offset_mm.abs() + margin,
        );
        let back = h.disc_thickness_mm + h.body.length_mm;
        let body =
            Cylinder::between(behind(h.disc_thickness_mm), behind(back + margin), h.body.radius_mm + margin);
        let (crank, end) = (behind(h.crank.behind_mm), shaft_axis * h.shaft.from_mm);
        let thick = h.crank.radius_mm + margin;
        // past its axis by its radius, where it meets the web that leads to the shaft
        let bar = Cylinder::between(crank, crank + end + shaft_axis * thick, thick);
        let web = Cylinder::between(end + crank - n * thick, end + n * margin, thick);
        let shaft = Cylinder::between(
            shaft_axis * (h.shaft.from_mm - margin),
            shaft_axis * (4.0 * description.mirror.a),
            h.shaft.radius_mm + margin,
        );
        let reach = [
            disc.radius + disc.length,
            (back + margin).hypot(body.radius),
            (h.crank.behind_mm + thick).hypot(h.shaft.from_mm + 2.0 * thick),
        ]
        .into_iter()
        .fold(0.0, f64::max);
        Self { parts: vec![disc, body, bar, web], reach, shaft, pupil: optics.pupil_mm() }
    }

    /// Whether the holder stands between the sample and the mirror point, or between that and the pupil.
    #[must_use]
    pub fn hides(&self, mirror_mm: Vec3) -> bool {
        let on = self.pupil - mirror_mm;
        if self.shaft.hit(Vec3::ZERO, mirror_mm) || self.shaft.hit(mirror_mm, on) {
            return true;
        }
        // parts beside the sample, seen from it
        if self.parts.iter().skip(2).any(|c| c.hit(Vec3::ZERO, mirror_mm)) {
            return true;
        }
        let t = (-mirror_mm.dot(on) / on.norm_squared()).clamp(0.0, 1.0);
        (mirror_mm + on * t).norm() < self.reach && self.parts.iter().any(|c| c.hit(mirror_mm, on))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_hits_a_cylinder_through_its_side_and_its_ends_only() {
        let c = Cylinder::between(Vec3::ZERO, Vec3::new(0.0, 0.0, 10.0), 2.0);
        let hit = |p: [f64; 3], q: [f64; 3]| c.hit(Vec3::from(p), Vec3::from(q) - Vec3::from(p));
        assert!(hit([-5.0, 0.0, 5.0], [5.0, 0.0, 5.0]));
        assert!(hit([0.0, 1.0, -5.0], [0.0, 1.0, 15.0]));
        assert!(!hit([-5.0, 2.1, 5.0], [5.0, 2.1, 5.0]));
        assert!(!hit([-5.0, 0.0, 10.1], [5.0, 0.0, 10.1]));
        assert!(!hit([-5.0, 0.0, 5.0], [-3.0, 0.0, 5.0]));
    }
}
