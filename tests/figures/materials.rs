//! Real materials, fitted without starting values. Needs `GONIO_DATA`.

use std::path::Path;

use gonio::fitting::{self, Subject};
use gonio::report::{self, Background};
use gonio_brdf::formats;
use gonio_tests::{RealData, real_data};

use crate::Figure;

const MATERIALS: &[&str] = &[
    "cornell/cayman.brdf",
    "cornell/krylon_blue.brdf",
    "mbsdf/carpaint_blue.mbsdf",
    "rgl/cc_ibiza_sunset_rgb.bsdf",
    "nbrdf/merl_nbrdf.f32#blue-metallic-paint",
    "nbrdf/merl_nbrdf.f32#color-changing-paint1",
    "nbrdf/merl_nbrdf.f32#red-specular-plastic",
];

/// Status of each fit.
pub fn figures() -> Vec<Figure> {
    let Some(data) = real_data("figures of real materials") else {
        return vec![Figure::said("real materials", "GONIO_DATA is unset: did not run", "-", None, true)];
    };
    MATERIALS.iter().map(|name| figure(&data, name)).collect()
}

/// As `gonio fit FILE --report R.html` does it.
fn figure(data: &RealData, name: &str) -> Figure {
    let (file, material) = name.split_once('#').map_or((name, None), |(f, m)| (f, Some(m)));
    let mut input = data.file(file).display().to_string();
    if let Some(m) = material {
        input += &format!("#{m}");
    }
    let subject = formats::open(Path::new(&input))
        .map_err(|e| e.to_string())
        .and_then(|loaded| Subject::of(&loaded).map_err(|e| e.to_string()))
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let options = fitting::options("auto", None, 75.0, subject.has_sigma).expect("valid options");
    let fit = gonio_fitter::fit(&subject.observations, &options);
    let html = report::build(subject.table.as_ref(), Some(&fit), Background::default()).to_html();
    let told = html.is_ok_and(|h| h.contains(fit.status.name()));
    let delta = fit.delta_e.beyond_15_deg.map_or_else(|| "-".to_owned(), |d| format!("{:.2}", d.mean));
    let ended = !matches!(fit.status.name(), "no-data" | "non-finite");
    let value = format!("{}, mean ΔE beyond 15°: {delta}", fit.status.name());
    Figure::said(name, value, "status, report", None, ended && told)
}
