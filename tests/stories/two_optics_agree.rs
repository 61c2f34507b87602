//! The virtual instrument traces its mirror with code of its own, the evaluation inverts it with other code: where both look
//! at the same instrument, nominal or out of alignment, they must see the same.

use gonio_acquisition::optics::Optics;
use gonio_acquisition::pixel_map::PixelMap;
use gonio_instrument::{Description, Misalignment, Pose, builtin};
use gonio_optics::{Angle, Vec3};
use gonio_sim::optics::{Sample, VirtualOptics};

fn tiny() -> Description {
    builtin::description("tiny").expect("built in").expect("readable")
}

/// Largest angle between the two views of a pixel over a coarse set of pixels, and how many both see.
fn largest_disagreement(errors: &Misalignment, pose: Pose) -> (Angle, Angle, usize) {
    let description = tiny();
    let virtual_optics = VirtualOptics::new(&description, errors);
    let calibrated = Description { calibration: Some(errors.clone()), ..description.clone() };
    let (optics, map) = (Optics::new(&calibrated), PixelMap::new(&calibrated));
    // the encoder's tilt plus the zero error is where the holder stands
    let readback = Pose { tilt: pose.tilt - Angle::from_degrees(errors.tilt_zero_deg), ..pose };
    let (sample_from_lab, theta_i) = map.frame(readback);
    let sample = Sample::diffuser(0.5);
    let (mut lab, mut sample_frame, mut seen) = (Angle::ZERO, Angle::ZERO, 0);
    for row in 0..description.camera.size[1] {
        for column in 0..description.camera.size[0] {
            let Some(sight) = virtual_optics.trace_pixel(pose, &sample, column, row) else { continue };
            let centre = (f64::from(column) + 0.5, f64::from(row) + 0.5);
            let here = optics.view(centre.0, centre.1).expect("both see the mirror").direction;
            lab = lab.max(here.angle_to(sight.view_lab));
            // azimuths count from the light in both
            let g = gonio_optics::Geometry::from_directions(
                Vec3::from_polar(theta_i, Angle::ZERO),
                sample_from_lab.apply(here),
            );
            let view = |g: gonio_optics::Geometry| Vec3::from_polar(g.theta_o, g.phi);
            sample_frame = sample_frame.max(view(g).angle_to(view(sight.geometry)));
            sample_frame = sample_frame.max((g.theta_i - sight.geometry.theta_i).abs());
            seen += 1;
        }
    }
    (lab, sample_frame, seen)
}

#[test]
fn on_the_nominal_instrument() {
    for tilt in [5.0, 40.0, 75.0] {
        let (lab, sample, seen) =
            largest_disagreement(&Misalignment::default(), Pose::from_degrees(tilt, 0.0));
        assert!(seen > 3000, "only {seen} pixels");
        assert!(lab.degrees() < 1e-6 && sample.degrees() < 1e-5, "tilt {tilt}: {lab} {sample}");
    }
}

#[test]
fn on_an_instrument_out_of_alignment_whose_calibration_is_known() {
    let errors = builtin::misalignment().expect("readable");
    for tilt in [10.0, 60.0] {
        let (lab, sample, seen) = largest_disagreement(&errors, Pose::from_degrees(tilt, 0.0));
        assert!(seen > 3000, "only {seen} pixels");
        // what remains is the parallax of a spot that is off the sample's spin axis
        assert!(lab.degrees() < 0.02 && sample.degrees() < 0.02, "tilt {tilt}: {lab} {sample}");
    }
}
