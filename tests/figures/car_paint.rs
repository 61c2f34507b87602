//! A paint of single flakes fitted as a user fits it: the BRDF over twelve spins of the virtual instrument, the flakes from its texture camera.

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use gonio_paint::car_paint::read_paint;

use crate::{Figure, scans};

const SILVER: &str = include_str!("../../docs/paints/silver.toml");
const SPINS: &str = include_str!("../../docs/paints/spins.toml");

/// Colour differences of the fit without flakes, with textures as recorded, and with textures at the level of the measurement.
pub fn figures() -> Vec<Figure> {
    let folder = scans::path("car-paint");
    let figures = measured(&folder);
    let _ = std::fs::remove_dir_all(&folder);
    figures.unwrap_or_else(|e| vec![Figure::said("car paint of single flakes", e, "done", Some(11), false)])
}

fn measured(folder: &Path) -> Result<Vec<Figure>, String> {
    std::fs::create_dir_all(folder).map_err(|e| e.to_string())?;
    let at = |name: &str| folder.join(name).into_os_string();
    std::fs::write(at("silver.toml"), SILVER).map_err(|e| e.to_string())?;
    std::fs::write(at("spins.toml"), SPINS).map_err(|e| e.to_string())?;
    let run = |words: &[&str]| {
        // a word that begins with / names a file of the folder
        let words = words.iter().map(|w| w.strip_prefix('/').map_or_else(|| OsString::from(w), at));
        let all = std::iter::once(OsString::from("gonio")).chain(words);
        match gonio::run(all.collect::<Vec<_>>()) {
            code if code == ExitCode::SUCCESS => Ok(()),
            _ => Err("a command failed".to_owned()),
        }
    };
    run(&["scan", "--texture", "--truth", "/silver.toml", "-o", "/T.mcap", "--force"])?;
    run(&[
        "scan",
        "--instrument",
        "tiny",
        "--plan",
        "/spins.toml",
        "--truth",
        "/silver.toml",
        "-o",
        "/S.mcap",
        "--fit=lambert",
        "--force",
    ])?;
    let fit = |more: &[&str]| -> Result<[f64; 2], String> {
        let words = ["fit", "/S.nc", "--model", "car-paint", "--coat", "1.5", "-o", "/x.paint", "--force"];
        run(&[&words[..], more].concat())?;
        let bytes = std::fs::read(at("x.paint")).map_err(|e| e.to_string())?;
        let (_, notes) = read_paint(&bytes).map_err(|e| e.to_string())?;
        let mean = |zone: &str| notes["fit"]["delta_e"][zone]["mean"].as_f64().unwrap_or(f64::INFINITY);
        Ok([mean("beyond_15_deg"), mean("within_15_deg")])
    };
    let without = fit(&[])?;
    let kept = fit(&["--flakes", "/T.textures", "--keep-flake-level"])?;
    let level = fit(&["--flakes", "/T.textures"])?;
    let words = |[beyond, within]: [f64; 2]| format!("{beyond:.2}, {within:.2}");
    Ok(vec![
        Figure::said("ΔE beyond, within 15°: no flakes", words(without), "-", Some(11), true),
        Figure::said("the same, textures as recorded", words(kept), "-", Some(11), true),
        // flakes must not cost colour: what one paint without flakes reaches on the same measurement, and a tenth
        Figure::said(
            "the same, textures at the measured level",
            words(level),
            "≤ 1.1 × no flakes",
            Some(11),
            level[0] <= 1.1 * without[0] && level[1] <= 1.1 * without[1],
        ),
    ])
}
