//! How much light arrives.

use gonio_brdf::{Brdf, Grid, Measured, ModelFile};
use gonio_instrument::{Description, Misalignment, Pose};
use gonio_optics::{Vec3, fresnel};
use gonio_sim::optics::lamp::rings;
use gonio_sim::optics::{RateMap, Sample, VirtualOptics};

use crate::{errors, instrument};

fn model(json: &str) -> ModelFile {
    ModelFile::from_json(json).expect("a model")
}

fn rate(map: &RateMap, column: u32, row: u32) -> f64 {
    f64::from(map.rates[(row * map.width + column) as usize])
}

#[test]
fn white_obeys_lambert_and_the_cos4_law() {
    let d = instrument("reference");
    let optics = VirtualOptics::new(&d, &Misalignment::default());
    let white = Sample::model(model(r#"{"model":"lambert","diffuse":[0.98,0.98,0.98]}"#));
    for tilt in [0.0, 75.0] {
        let pose = Pose::from_degrees(tilt, 0.0);
        let map = optics.rate_map(pose, 0.0, &white);
        let mut checked = 0;
        for row in (0..1024u32).step_by(37) {
            for column in (0..1280u32).step_by(41) {
                let whole = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].iter().all(|(u, v)| {
                    let (c, r) = (f64::from(column) + u, f64::from(row) + v);
                    optics.trace_place(pose, 0.0, &white, c, r).is_some_and(|s| s.lit == 1.0)
                });
                if !whole {
                    continue;
                }
                let x = (f64::from(column) + 0.5 - 640.0) * 0.005 / 3.0;
                let y = (f64::from(row) + 0.5 - 512.0) * 0.005 / 3.0;
                let k = 0.88 / (1.0 + x * x + y * y).powi(2);
                let expected =
                    optics.scale_e_per_s() * k * 0.98 / std::f64::consts::PI * tilt.to_radians().cos();
                let got = rate(&map, column, row);
                // the directions in the file have five digits: θi is the tilt within 1e-5
                assert!((got / expected - 1.0).abs() < 1e-4, "({column}, {row}): {got} against {expected}");
                checked += 1;
            }
        }
        assert!(checked > 200, "{checked} pixels at tilt {tilt}");
    }
}

#[test]
fn white_in_normal_light_fills_half_the_well_in_20_ms() {
    let d = instrument("reference");
    let optics = VirtualOptics::new(&d, &Misalignment::default());
    let map = optics.rate_map(Pose::from_degrees(0.0, 0.0), 0.0, &Sample::diffuser(0.98));
    let brightest = map.rates.iter().fold(0.0f32, |a, &b| a.max(b));
    let share = f64::from(brightest) * 0.020 / d.camera.full_well_e;
    assert!((0.48..=0.5001).contains(&share), "{share}");
}

/// Sum over pixels of `rate / (G k)` times the pixel's solid angle seen from the sample: ∫ f cos θ' dω over what is seen.
fn collected(optics: &VirtualOptics, d: &Description, pose: Pose, sample: &Sample) -> f64 {
    let map = optics.rate_map(pose, 0.0, sample);
    let mut sum = 0.0;
    for row in 0..d.camera.size[1] {
        for column in 0..d.camera.size[0] {
            let r = rate(&map, column, row);
            if r == 0.0 {
                continue;
            }
            let at = |u: f64, v: f64| {
                optics
                    .trace_place(pose, 0.0, sample, f64::from(column) + u, f64::from(row) + v)
                    .map(|s| (s.view, s.k))
            };
            let (Some(a), Some(b), Some(c), Some(e), Some(m)) =
                (at(0.0, 0.5), at(1.0, 0.5), at(0.5, 0.0), at(0.5, 1.0), at(0.5, 0.5))
            else {
                continue;
            };
            let solid = (b.0 - a.0).cross(e.0 - c.0).norm();
            sum += r / (optics.scale_e_per_s() * m.1) * solid;
        }
    }
    sum
}

#[test]
fn black_glass_returns_the_fresnel_share_whatever_the_pixel_size() {
    // tiny pixels are nearly as wide as the image, and F and k vary inside them
    for (name, errors, tilt, tolerance) in [
        ("tiny", Misalignment::default(), 60.0, 0.02),
        ("tiny", errors(), 40.0, 0.02),
        ("reference", Misalignment::default(), 60.0, 2e-3),
        ("reference", errors(), 40.0, 2e-3),
    ] {
        let d = instrument(name);
        let optics = VirtualOptics::new(&d, &errors);
        let glass = Sample::glass(1.567);
        let pose = Pose::from_degrees(tilt, 0.0);
        let got = collected(&optics, &d, pose, &glass);
        let sight = (0..d.camera.size[0])
            .find_map(|c| optics.trace_pixel(pose, &glass, c, d.camera.size[1] / 2))
            .expect("something is seen");
        let alpha = 0.5f64.to_radians();
        // ∫ F/Ω dω over the mirror image: 2π(1 − cos α)/(π sin² α)
        let expected =
            fresnel::dielectric(sight.light.z, 1.567) * 2.0 * (1.0 - alpha.cos()) / alpha.sin().powi(2);
        assert!((got / expected - 1.0).abs() < tolerance, "{name} {tilt}: {got} against {expected}");
    }
}

/// Mean over pixel and lamp with far more points than the tracer takes.
fn brute_force(
    optics: &VirtualOptics,
    pose: Pose,
    sample: &Sample,
    column: u32,
    row: u32,
    channel: usize,
) -> Option<f64> {
    let places = 16;
    let lamp = rings(12);
    let mut sum = 0.0;
    for j in 0..places {
        for i in 0..places {
            let c = f64::from(column) + (f64::from(i) + 0.5) / f64::from(places);
            let r = f64::from(row) + (f64::from(j) + 0.5) / f64::from(places);
            let s = optics.trace_place(pose, 0.0, sample, c, r)?;
            let disc = optics.lamp().seen_along(s.light);
            let mean: f64 = lamp
                .iter()
                .map(|&p| {
                    let (l, inverse_cos) = disc.direction(p);
                    sample.base.eval(l, s.view)[channel] * l.z.max(0.0) * inverse_cos
                })
                .sum::<f64>()
                / lamp.len() as f64;
            sum += s.lit * s.k * mean;
        }
    }
    Some(optics.scale_e_per_s() * sum / f64::from(places * places))
}

#[test]
fn lobes_are_averaged_within_a_thousandth_and_needles_within_two_percent_of_their_peak() {
    // (instrument, exponent, places of the pixel from the peak, bound on |error|, relative to the value or to the peak)
    let near: &[(i32, i32)] = &[(0, 0), (1, 0), (-1, 2)];
    let wide: &[(i32, i32)] = &[(0, 0), (7, 0), (-5, 9), (30, -20)];
    let cases = [
        ("reference", 120.0, wide, 1e-3, false),
        ("reference", 1300.0, wide, 1e-3, false),
        ("reference", 1e5, near, 0.02, true),
        ("tiny", 120.0, near, 1e-3, false),
        ("tiny", 410.0, near, 1e-3, false),
        ("tiny", 1300.0, near, 1e-3, false),
        ("tiny", 1e5, near, 0.02, true),
    ];
    let mut checked = 0;
    for (name, exponent, places, bound, of_peak) in cases {
        let d = instrument(name);
        let optics = VirtualOptics::new(&d, &Misalignment::default());
        let sample = Sample::model(model(&format!(
            r#"{{"model":"ashikhmin-shirley-simplified","diffuse":[0.1,0.1,0.1],"specular":[0.3,0.3,0.3],"exponent":{exponent}}}"#
        )));
        let pose = Pose::from_degrees(if exponent > 500.0 { 40.0 } else { 70.0 }, 0.0);
        let map = optics.rate_map(pose, 0.0, &sample);
        let (brightest, peak) = map
            .rates
            .iter()
            .enumerate()
            .fold((0, 0.0f32), |best, (i, &r)| if r > best.1 { (i, r) } else { best });
        let (pc, pr) = ((brightest as u32 % map.width) as i32, (brightest as u32 / map.width) as i32);
        for &(i, j) in places {
            let (c, r) = ((pc + i) as u32, (pr + j) as u32);
            let channel = d.camera.pattern.channel(c, r) as usize;
            let exact = brute_force(&optics, pose, &sample, c, r, channel).expect("on the sample");
            let scale = if of_peak { f64::from(peak) } else { exact };
            let off = (rate(&map, c, r) - exact).abs() / scale;
            assert!(
                off < bound,
                "{name}, exponent {exponent}, pixel ({c}, {r}), peak ({pc}, {pr}): off by {off:.1e}"
            );
            checked += 1;
        }
    }
    assert_eq!(checked, 23);
}

#[test]
fn the_kinks_of_a_measured_table_cost_half_a_thousandth_on_the_mean_and_a_few_percent_nowhere() {
    let d = instrument("reference");
    let optics = VirtualOptics::new(&d, &Misalignment::default());
    let lobe = model(
        r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.1,0.1,0.1],"specular":[0.3,0.3,0.3],"exponent":120}"#,
    );
    let sample = Sample::table(Measured::sampled(Grid::sopp(), &lobe));
    // the lamp's centre lies on a node of θi, the worst place
    let pose = Pose::from_degrees(75.0, 0.0);
    let map = optics.rate_map(pose, 0.0, &sample);
    let (mut sum, mut worst, mut checked) = (0.0, 0.0f64, 0);
    for row in (61..1024).step_by(43) {
        for column in (71..1280).step_by(97) {
            let channel = d.camera.pattern.channel(column, row) as usize;
            let Some(exact) = brute_force(&optics, pose, &sample, column, row, channel) else { continue };
            let off = (rate(&map, column, row) / exact - 1.0).abs();
            sum += off;
            worst = worst.max(off);
            checked += 1;
        }
    }
    assert!(checked > 90, "{checked} pixels");
    let mean = sum / f64::from(checked);
    assert!(mean < 5e-4 && worst < 0.02, "mean {mean:.1e}, worst {worst:.1e} of {checked} pixels");
}

#[test]
fn a_coated_sample_shows_its_base_through_the_coat() {
    let d = instrument("reference");
    let optics = VirtualOptics::new(&d, &Misalignment::default());
    let file = model(r#"{"model":"lambert","diffuse":[0.5,0.4,0.3],"coat":{"index":1.5}}"#);
    let sample = Sample::model(file.clone());
    let pose = Pose::from_degrees(45.0, 0.0);
    let map = optics.rate_map(pose, 0.0, &sample);
    let mut checked = 0;
    for row in (1..1024).step_by(101) {
        for column in (1..1280).step_by(97) {
            let Some(s) = optics.trace_pixel(pose, &sample, column, row) else { continue };
            let mirror = Vec3::new(-s.light.x, -s.light.y, s.light.z);
            if s.lit < 1.0 || s.geometry.theta_o.degrees() > 75.0 || s.view.angle_to(mirror).degrees() < 1.0 {
                continue;
            }
            let c = d.camera.pattern.channel(column, row) as usize;
            let expected = optics.scale_e_per_s() * s.k * file.eval(s.light, s.view)[c] * s.light.z;
            let got = rate(&map, column, row);
            assert!((got / expected - 1.0).abs() < 1e-3, "({column}, {row}): {got} against {expected}");
            checked += 1;
        }
    }
    assert!(checked > 20, "{checked} pixels");
}

#[test]
fn the_map_does_not_depend_on_the_number_of_threads() {
    let optics = VirtualOptics::new(&instrument("tiny"), &errors());
    let sample = Sample::glass(1.5);
    let pose = Pose::from_degrees(33.0, 12.0);
    let with = |n: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .expect("a pool")
            .install(|| optics.rate_map(pose, 0.0, &sample))
    };
    assert_eq!(with(1), with(3));
}
