//! Real materials, fitted without starting values. Needs `GONIO_DATA`.

use gonio_tests::real_data;

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
        return vec![Figure::said("real materials", "GONIO_DATA is unset: did not run", "-", "-", true)];
    };
    MATERIALS
        .iter()
        .map(|name| {
            let file = data.file(name.split('#').next().unwrap_or(name));
            let input = name.split_once('#').map_or_else(
                || file.display().to_string(),
                |(_, material)| format!("{}#{material}", file.display()),
            );
            let report = crate::scans::path("material.report.html");
            let model = crate::scans::path("material.model.json");
            let words = ["gonio", "fit", &input, "--force", "-o"]
                .map(std::ffi::OsString::from)
                .into_iter()
                .chain([model.clone().into(), "--report".into(), report.clone().into()]);
            let code = gonio::run(words);
            let fit: Option<serde_json::Value> =
                std::fs::read_to_string(&model).ok().and_then(|t| serde_json::from_str(&t).ok());
            let status = fit.as_ref().and_then(|f| f["fit"]["status"].as_str()).unwrap_or("none").to_owned();
            let delta = fit.as_ref().and_then(|f| f["fit"]["delta_e"]["beyond_15_deg"]["mean"].as_f64());
            let told = std::fs::metadata(&report).is_ok_and(|m| m.len() > 1000);
            let _ = std::fs::remove_file(&model);
            let _ = std::fs::remove_file(&report);
            Figure::said(
                *name,
                format!(
                    "{status}, mean ΔE beyond 15°: {}",
                    delta.map_or("–".to_owned(), |d| format!("{d:.2}"))
                ),
                "status, report",
                "-",
                code == std::process::ExitCode::SUCCESS && told && status != "none",
            )
        })
        .collect()
}
