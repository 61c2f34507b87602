//! Where a calibration expects what is observed, and how that moves with each parameter.

use gonio_instrument::{Description, Pose, ScanKind};
use gonio_optics::{Angle, Rotation, Vec3};

use super::parameters::{COUNT, Estimate, Glass, PARAMETERS, Row};
use crate::optics::{Image, Optics};

/// Step of the central differences, tolerances. The error of a difference is of the order of its square times the curvature: 1e-8 of a pixel.
const STEP: f64 = 1e-3;

/// Normal of the glass at a pose read back, lab frame.
#[must_use]
pub fn glass_normal(optics: &Optics, glass: &Glass, kind: ScanKind, pose: Pose) -> Vec3 {
    let n = optics.normal(pose.tilt);
    // the sample's axes at spin 0, turned with the spin: x away from the tilt axis, where the light lies for positive tilts
    let x = Rotation::about_axis(n, pose.spin).apply(n.cross(optics.tilt_axis()).normalized());
    let y = n.cross(x);
    if kind == ScanKind::BlackGlassWedge {
        let (s, c) = glass.wedge_deg.to_radians().sin_cos();
        let (sa, ca) = glass.wedge_azimuth_deg.to_radians().sin_cos();
        return n * c + (x * ca + y * sa) * s;
    }
    let [lx, ly] = glass.flat_lean_deg.map(f64::to_radians);
    (n + x * lx + y * ly).normalized()
}

/// Direction from the glass in which the lamp's mirror image is seen, lab frame; `None` where the lamp shines on its back.
#[must_use]
pub fn mirror_direction(optics: &Optics, glass: &Glass, kind: ScanKind, pose: Pose) -> Option<Vec3> {
    let n = glass_normal(optics, glass, kind, pose);
    let cos = n.dot(optics.lamp());
    (cos > 0.02).then(|| n * (2.0 * cos) - optics.lamp())
}

/// The lamp's mirror image on the sensor; `None` where there is none.
#[must_use]
pub fn spot(
    optics: &Optics,
    glass: &Glass,
    kind: ScanKind,
    pose: Pose,
    lamp_half_angle: Angle,
) -> Option<Image> {
    optics.image(mirror_direction(optics, glass, kind, pose)?, lamp_half_angle.radians())
}

/// Derivatives of `f` with respect to the parameters, per tolerance, by central differences; `None` where `f` has no value.
pub fn derivatives<const N: usize>(
    description: &Description,
    at: &Row,
    f: &(dyn Fn(&Optics, &Glass) -> Option<[f64; N]> + Sync),
) -> Option<[[f64; COUNT]; N]> {
    derivatives_with(STEP, description, at, f)
}

pub(crate) fn derivatives_with<const N: usize>(
    step: f64,
    description: &Description,
    at: &Row,
    f: &(dyn Fn(&Optics, &Glass) -> Option<[f64; N]> + Sync),
) -> Option<[[f64; COUNT]; N]> {
    let value = |row: &Row| {
        let e = Estimate::from_row(row);
        f(&Optics::with(description, &e.instrument), &e.glass)
    };
    let mut out = [[0.0; COUNT]; N];
    for k in 0..COUNT {
        let (mut ahead, mut behind) = (*at, *at);
        ahead[k] += step * PARAMETERS[k].tolerance;
        behind[k] -= step * PARAMETERS[k].tolerance;
        let (a, b) = (value(&ahead)?, value(&behind)?);
        for (row, (a, b)) in out.iter_mut().zip(a.iter().zip(&b)) {
            row[k] = (a - b) / (2.0 * step);
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_instrument::builtin;

    #[test]
    fn the_jacobian_does_not_depend_on_the_step_of_its_differences() {
        let d = builtin::description("reference").expect("known").expect("readable");
        let e = Estimate {
            instrument: builtin::misalignment().expect("readable"),
            glass: Glass { flat_lean_deg: [0.02, -0.03], wedge_deg: 21.3, wedge_azimuth_deg: 170.0 },
        };
        let alpha = d.lamp.half_angle();
        for (kind, tilt, spin) in
            [(ScanKind::BlackGlass, 40.0, 30.0), (ScanKind::BlackGlassWedge, 30.0, 100.0)]
        {
            let f = |o: &Optics, g: &Glass| {
                spot(o, g, kind, Pose::from_degrees(tilt, spin), alpha).map(|i| i.centroid_px)
            };
            let used = derivatives(&d, &e.to_row(), &f).expect("visible");
            // Richardson's extrapolation of two other steps
            let [coarse, fine] =
                [4e-2, 2e-2].map(|h| derivatives_with(h, &d, &e.to_row(), &f).expect("visible"));
            for axis in 0..2 {
                for k in 0..COUNT {
                    let best = (4.0 * fine[axis][k] - coarse[axis][k]) / 3.0;
                    let off = (used[axis][k] - best).abs();
                    assert!(
                        off < 2e-5 * (1.0 + best.abs()),
                        "{kind:?} {}: {off:e} of {best}",
                        PARAMETERS[k].name
                    );
                }
            }
        }
    }

    #[test]
    fn the_wedge_leans_from_the_spin_axis_and_turns_with_the_spin() {
        let d = builtin::description("reference").expect("known").expect("readable");
        let optics = Optics::new(&d);
        let glass = Glass { wedge_deg: 20.0, wedge_azimuth_deg: 40.0, ..Glass::default() };
        let n =
            |spin| glass_normal(&optics, &glass, ScanKind::BlackGlassWedge, Pose::from_degrees(30.0, spin));
        let axis = optics.normal(Angle::from_degrees(30.0));
        for spin in [0.0, 90.0, 200.0] {
            assert!((n(spin).angle_to(axis).degrees() - 20.0).abs() < 1e-9);
        }
        assert!((n(10.0).angle_to(n(190.0)).degrees() - 40.0).abs() < 1e-9);
        // opposite to the azimuth the lean points away from the light: at spin −40 it points towards it
        assert!(n(-40.0).dot(optics.lamp()) > n(140.0).dot(optics.lamp()));
    }
}
