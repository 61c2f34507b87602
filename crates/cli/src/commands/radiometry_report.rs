//! A radiometric calibration in words, as JSON and in pictures.

use std::path::{Path, PathBuf};

use gonio_acquisition::radiometry::Calibrated;
use gonio_instrument::radiometry::{Known, Radiometry};
use gonio_render::Picture;
use gonio_render::plots::{Chart, SensorMap};
use serde_json::{Value, json};

use crate::output::shown;

/// Photon transfer, linearity, dark current, stray light, gloss; `None` where there is nothing to show.
pub(super) fn pictures(c: &Calibrated) -> [Option<Picture>; 5] {
    let r = c.radiometry();
    let names = ["red", "green", "blue"];
    let mut lines: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
    for (channel, name) in names.iter().enumerate() {
        let mut own: Vec<(f64, f64)> = c
            .transfer
            .points
            .iter()
            .filter(|p| p.channel == channel)
            .map(|p| (p.signal, p.variance))
            .collect();
        own.sort_by(|a, b| a.0.total_cmp(&b.0));
        lines.push(((*name).to_owned(), own));
    }
    let gain = r.electrons_per_count[1].value;
    let read = (r.read_noise_e.value / gain).powi(2);
    let most = c.transfer.points.iter().map(|p| p.signal).fold(1.0, f64::max);
    let curve = (0..=60).map(|k| most.powf(f64::from(k) / 60.0)).map(|s| (s, read + s / gain)).collect();
    lines.push((format!("read noise and {gain:.3} e/count"), curve));
    let transfer = Chart {
        title: "Photon transfer".to_owned(),
        x_label: "signal, counts above black, linearised".to_owned(),
        y_label: "variance of a frame without rounding, counts²".to_owned(),
        logarithmic: [true, true],
        lines,
        ..Chart::default()
    };
    let of = |k: usize| r.linearity_levels.iter().map(|l| (100.0 * l[0], 100.0 * l[k])).collect();
    let linearity = Chart {
        title: "Departure from a straight line".to_owned(),
        x_label: "level, % of the range".to_owned(),
        y_label: "departure, % of the range".to_owned(),
        lines: vec![("as read".to_owned(), of(1)), ("linearised".to_owned(), of(2))],
        ..Chart::default()
    };
    let dark = SensorMap {
        title: format!(
            "Dark current{}; rings: {} hot and {} dead pixels",
            r.dark.temperature_c.map(|t| format!(" at {t:.1} °C")).unwrap_or_default(),
            r.hot.len(),
            r.dead.len()
        ),
        label: "electrons per second".to_owned(),
        size: c.description.camera.size,
        values: c.dark_map.clone(),
        marked: r.hot.iter().chain(&r.dead).take(500).copied().collect(),
    };
    let stray = c.stray.as_ref().filter(|f| !f.profile.is_empty()).map(|f| {
        let line = |k: usize| f.profile.iter().map(|p| (100.0 * p[0], 100.0 * p[k])).collect();
        Chart {
            title: "Light where there should be none".to_owned(),
            x_label: "glare and tails by the model, % of the picture's mean".to_owned(),
            y_label: "seen, % of the picture's mean".to_owned(),
            lines: vec![("seen".to_owned(), line(1)), ("model".to_owned(), line(0))],
            ..Chart::default()
        }
        .draw()
    });
    let gloss = (!c.gloss.is_empty()).then(|| {
        let mut points: Vec<(f64, f64)> = c.gloss.iter().map(|g| (g[0], 100.0 * (g[1] - 1.0))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Chart {
            title: "Black glass against Fresnel's reflectance".to_owned(),
            x_label: "θi, degrees".to_owned(),
            y_label: "measured over expected, less 1, %".to_owned(),
            lines: vec![("poses".to_owned(), points)],
            bound: r.gloss.as_ref().map(|g| ("scale".to_owned(), 100.0 * (g.scale.value - 1.0))),
            ..Chart::default()
        }
        .draw()
    });
    [Some(transfer.draw()), Some(linearity.draw()), Some(dark.draw()), stray, gloss]
}

fn known(k: Known, digits: usize) -> String {
    format!("{:.digits$} ± {:.digits$}", k.value, k.sigma)
}

/// For people.
pub(super) fn words(r: &Radiometry, c: &Calibrated, output: &Path) -> String {
    let g = r.electrons_per_count;
    let mut t = format!(
        "gain {}, {}, {} e/count (R, G, B); read noise {} e; full well {}{:.0} ± {:.0} e; photon-transfer misfit {:.2}\n",
        known(g[0], 4),
        known(g[1], 4),
        known(g[2], 4),
        known(r.read_noise_e, 3),
        if r.full_well_reached { "" } else { "at least " },
        r.full_well_e.value,
        r.full_well_e.sigma,
        c.transfer.reduced_chi2,
    );
    t += &format!("black level {} counts, clipped at {}\n", known(r.black_level, 3), r.clipped_at);
    t += &format!(
        "dark current {} e/s{}{}; largest departure from a line in the exposure {:.2} e\n",
        known(r.dark.current_e_s, 3),
        r.dark.temperature_c.map(|c| format!(" at {c:.1} °C")).unwrap_or_default(),
        r.dark.doubling_k.map(|k| format!(", doubling every {} K", known(k, 2))).unwrap_or_default(),
        r.dark.nonlinearity_e,
    );
    let most = |k: usize| 100.0 * r.linearity_levels.iter().map(|l| l[k].abs()).fold(0.0, f64::max);
    t += &format!(
        "linearity: y = x {:+.5} x² {:+.5} x³; largest departure {:.3} % of the range as read, {:.3} % linearised\n",
        r.linearity.get(1).copied().unwrap_or(0.0),
        r.linearity.get(2).copied().unwrap_or(0.0),
        most(1),
        most(2),
    );
    t += &format!("{} hot and {} dead pixels\n", r.hot.len(), r.dead.len());
    for l in &r.lamp {
        t += &format!(
            "lamp over {}: drift {:+.3} %, scatter {:.4} %, within a pose {:.4} %\n",
            l.session,
            100.0 * l.drift,
            100.0 * l.scatter,
            100.0 * l.within
        );
    }
    if let Some(f) = &r.flat {
        t += &format!(
            "flat field from {}: {:.1} % of the pixels, each to {:.3} %, all to {:.3} % (certificate); pixels differ by {:.3} ± {:.3} %\n",
            f.serial,
            100.0 * f.covered,
            100.0 * f.pixel_sigma,
            100.0 * f.certificate,
            100.0 * f.pixel_response.value,
            100.0 * f.pixel_response.sigma
        );
    }
    if let Some(g) = &r.gloss {
        t += &format!(
            "gloss scale {} (n = {}, {} poses){}\n",
            known(g.scale, 4),
            g.index,
            g.poses,
            g.half_angle_deg.map(|h| format!(", lamp's half angle {}°", known(h, 3))).unwrap_or_default()
        );
    }
    if let Some(s) = &r.stray {
        t += &format!(
            "stray light: glare {} %, tails {} % from {} mm on, κ of the camera's face {}, haze {}\n",
            known(percent(s.glare), 3),
            known(percent(s.tail_share), 3),
            known(s.tail_radius_mm, 4),
            s.face.map_or("unknown".to_owned(), |k| known(k, 5)),
            s.haze.as_ref().map_or("unknown".to_owned(), |h| {
                let mean = h.rates_e_s.iter().map(|v| f64::from(v[1])).sum::<f64>()
                    / h.rates_e_s.len().max(1) as f64;
                format!("{mean:.2} ± {:.2} e/s", h.sigma_e_s[1])
            })
        );
    }
    if let Some(k) = &r.colour {
        t += &format!(
            "colours through a matrix of {} patches of {}: ΔE left {:.2} on average, {:.2} at most\n",
            k.patches, k.chart, k.delta_e_mean, k.delta_e_max
        );
    }
    for n in &r.notes {
        t += &format!("note: {n}\n");
    }
    t + &format!("version {} written to {}\n", r.version, output.display())
}

fn percent(k: Known) -> Known {
    Known::new(100.0 * k.value, 100.0 * k.sigma)
}

/// For programs.
pub(super) fn to_json(
    r: &Radiometry,
    c: &Calibrated,
    output: &Path,
    pictures: &[PathBuf],
    lost: &[String],
) -> Value {
    json!({
        "output": shown(output), "pictures": pictures.iter().map(|p| shown(p)).collect::<Vec<_>>(),
        "version": r.version, "good": r.good, "notes": r.notes, "lost": lost,
        "transfer_chi2": c.transfer.reduced_chi2, "calibration": summary(r),
    })
}

/// A calibration's numbers without its long lists; `gonio info` shows the same.
pub(super) fn summary(r: &Radiometry) -> Value {
    json!({
        "version": r.version, "good": r.good, "sessions": r.sessions, "notes": r.notes,
        "electrons_per_count": r.electrons_per_count, "read_noise_e": r.read_noise_e,
        "full_well_e": r.full_well_e, "full_well_reached": r.full_well_reached, "black_level": r.black_level,
        "clipped_at": r.clipped_at, "linearity": r.linearity, "linearity_sigma": r.linearity_sigma,
        "linearity_levels": r.linearity_levels, "dark": r.dark, "hot_pixels": r.hot.len(), "dead_pixels": r.dead.len(),
        "lamp": r.lamp, "flat": r.flat, "gloss": r.gloss,
        "stray": r.stray.as_ref().map(|s| json!({
            "glare": s.glare, "tail_share": s.tail_share, "tail_radius_mm": s.tail_radius_mm, "face": s.face,
            "haze_sigma_e_s": s.haze.as_ref().map(|h| h.sigma_e_s),
        })),
        "colour": r.colour,
    })
}
