//! Geometric calibration of the misaligned virtual instrument, from scans of black glass and white through to directions.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use gonio::arguments::calibrate::{CommonArguments, GeometryArguments};
use gonio::arguments::{Kind, ScanArguments, VirtualArguments};
use gonio::commands::calibrate::{Calibrated, calibrate};
use gonio::commands::scan::scan;
use gonio_acquisition::PixelMap;
use gonio_instrument::{Cancel, Description, Misalignment, Pose, ScanKind, builtin};
use gonio_optics::{Angle, Vec3};
use gonio_sim::optics::{Sample, VirtualOptics};

use crate::{Figure, scans};

const SEED: u64 = 1;

fn session(kind: Kind, name: &str) -> PathBuf {
    let output = scans::path(name);
    let plain = scans::arguments(Path::new(""), &output, SEED, Vec::new());
    let simulated =
        VirtualArguments { truth: None, misalignment: Some(PathBuf::from("builtin")), ..plain.simulated };
    let arguments = ScanArguments { kind, fit: None, simulated, ..plain };
    scan(&arguments, &Cancel::new()).unwrap_or_else(|e| panic!("{name}: {e}"));
    output
}

/// Root mean square and largest error of (θi, θo, angle between light and view), degrees, over the pixels used (θo ≤ 75°).
fn direction_errors(description: &Description, truth: &Misalignment) -> ([f64; 3], [f64; 3]) {
    let nominal = Description { calibration: None, calibration_record: None, ..description.clone() };
    let optics = VirtualOptics::new(&nominal, truth);
    let map = PixelMap::new(description);
    let sample = Sample::diffuser(0.5);
    let (mut sum, mut most, mut n) = ([0.0; 3], [0.0f64; 3], 0.0);
    for tilt in [1.0, 5.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0] {
        let (sample_from_lab, theta_i) = map.frame(Pose::from_degrees(tilt, 0.0));
        let light = Vec3::from_polar(theta_i, Angle::ZERO);
        let actual = Pose::from_degrees(tilt + truth.tilt_zero_deg, 0.0);
        for row in (3..nominal.camera.size[1]).step_by(8) {
            for column in (3..nominal.camera.size[0]).step_by(8) {
                let Some(sight) = optics.trace_pixel(actual, &sample, column, row) else { continue };
                if sight.view.z < 75f64.to_radians().cos() {
                    continue;
                }
                let v =
                    sample_from_lab.apply(map.direction((row * nominal.camera.size[0] + column) as usize));
                let off = [
                    theta_i.degrees() - sight.geometry.theta_i.degrees(),
                    v.angle_to(Vec3::Z).degrees() - sight.geometry.theta_o.degrees(),
                    light.angle_to(v).degrees() - sight.light.angle_to(sight.view).degrees(),
                ];
                for ((s, m), o) in sum.iter_mut().zip(&mut most).zip(off) {
                    *s += o * o;
                    *m = m.max(f64::abs(o));
                }
                n += 1.0;
            }
        }
    }
    (sum.map(|s: f64| (s / n).sqrt()), most)
}

fn three(v: [f64; 3]) -> String {
    format!("{:.4} / {:.4} / {:.4}", v[0], v[1], v[2])
}

/// The calibration of the misaligned instrument, made once.
static CALIBRATION: LazyLock<Calibrated> = LazyLock::new(|| {
    let sessions = vec![
        session(Kind::BlackGlass, "flat.mcap"),
        session(Kind::BlackGlassWedge, "wedge.mcap"),
        session(Kind::White, "calibration-white.mcap"),
    ];
    let arguments = GeometryArguments {
        sessions: sessions.clone(),
        common: CommonArguments { output: scans::path("calibrated.toml"), instrument: None, index: 1.567 },
        repeatability_deg: builtin::misalignment().expect("built in").tilt_repeatability_deg,
        picture: None,
    };
    let c = calibrate(&arguments).unwrap_or_else(|e| panic!("calibration: {e}"));
    for s in sessions {
        let _ = std::fs::remove_file(s);
    }
    c
});

/// The description that the calibration of the misaligned instrument gives.
pub fn calibrated() -> Description {
    CALIBRATION.description.clone()
}

/// All figures of the geometric calibration.
pub fn figures() -> Vec<Figure> {
    let truth = builtin::misalignment().expect("built in");
    let c = &*CALIBRATION;
    let nominal = Description { calibration: None, calibration_record: None, ..c.description.clone() };
    let (before_rms, before_max) = direction_errors(&nominal, &truth);
    let (rms, most) = direction_errors(&c.description, &truth);
    let used = |edge: bool| c.solution.residuals.iter().filter(|r| r.edge == edge && !r.rejected).count();
    let worst = |v: [f64; 3]| v.into_iter().fold(0.0, f64::max);
    let wedge = ScanKind::BlackGlassWedge.name();
    let on_wedge = c.solution.residuals.iter().filter(|r| !r.edge && r.name.contains("wedge")).count();
    let stated = |name: &str, value: String| Figure::said(name, value, "stated", Some(SEED), true);
    vec![
        stated("direction error before, ° r.m.s. (θi, θo, l to v)", three(before_rms)),
        stated("direction error before, ° largest", three(before_max)),
        stated(
            "spots (on the wedge) and edge points used",
            format!("{} ({on_wedge} {wedge}), {}", used(false), used(true)),
        ),
        stated("residual of a spot's coordinate, px r.m.s.", format!("{:.4}", c.solution.rms_px)),
        stated("uncertainty that the fit states, ° r.m.s.", three(c.verdict.after.rms_deg)),
        Figure::at_most(
            format!("direction error after, ° r.m.s. ({})", three(rms)),
            worst(rms),
            0.03,
            Some(SEED),
        ),
        Figure::at_most(
            format!("direction error after, ° largest ({})", three(most)),
            worst(most),
            0.1,
            Some(SEED),
        ),
    ]
}
