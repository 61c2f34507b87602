//! The WGSL flakes on a Vulkan device (Mesa's lavapipe counts), through wgpu, against what the library draws and blends.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use gonio_brdf::Coat;
use gonio_optics::{Angle, Vec3};
use gonio_paint::car_paint::{FlakeSlices, Flakes};
use gonio_paint::mixing::{Mixable, Part};
use gonio_paint::statistics::StatisticsOptions;
use gonio_paint::{CarPaint, CarPaintParts, FlakeBtf};
use serde_json::json;

const TEXEL_MM: f64 = 0.125;

/// Noise and bright flakes, from a seed.
fn paint(seed: u64) -> Arc<CarPaint> {
    let mut state = seed;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as f32 + 0.5) / (1_u64 << 31) as f32
    };
    let angles = |n: usize| (0..n).map(|k| Angle::from_degrees(6.0 * k as f64)).collect::<Vec<_>>();
    let texels = (0..5 * 6 * 32 * 32)
        .map(|_| {
            let bright = if unit() < 0.04 { 2.0 * unit() } else { 0.05 };
            [bright * unit(), bright * unit(), bright * (0.2 + 0.1 * seed as f32)]
        })
        .collect();
    let btf = FlakeBtf::new(angles(5), angles(6), [32, 32], texels).expect("sound");
    let flakes = FlakeSlices::new(Arc::new(btf), TEXEL_MM).expect("sound");
    let parts = CarPaintParts {
        coat: Some(Coat { index: 1.5 }),
        flakes: Some(Flakes::Slices(flakes)),
        ..CarPaintParts::default()
    };
    Arc::new(CarPaint::new(parts).expect("sound"))
}

/// Directions up to grazing, with places of the surface: middles of texels.
fn looks() -> Vec<[f64; 8]> {
    let mut state = 9_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1_u64 << 31) as f64
    };
    let mut direction = || {
        let (z, phi) = (0.05 + 0.95 * unit(), 6.2 * unit());
        let r = (1.0 - z * z).sqrt();
        [r * phi.cos(), r * phi.sin(), z]
    };
    (0..4000)
        .map(|k| {
            let ([a, b, c], [d, e, f]) = (direction(), direction());
            let texel = |n: i32| (f64::from(n) + 0.5) * TEXEL_MM;
            [a, b, c, d, e, f, texel(k % 613 - 300), texel(k % 401 - 200)]
        })
        .collect()
}

#[test]
fn flakes_drawn_and_blended_by_the_shader_are_those_of_the_library() {
    let folder = tempfile::tempdir().expect("a folder");
    let shader = folder.path().join("flakes.wgsl");
    std::fs::write(&shader, gonio_render::shaders::FLAKES_WGSL).expect("written");
    let paints = [paint(1), paint(2), paint(3)];
    let m = Mixable::new(&paints, &StatisticsOptions::default()).expect("mixable");
    let buffers = m.shader_flakes().expect("flakes");
    let looks = looks();
    for (weights, part) in [
        ([0.5, 0.3, 0.2], Part::Everything),
        ([0.2, 1.1, -0.3], Part::Lightness),
        ([0.0, 0.6, 0.4], Part::Hue),
    ] {
        let [lightness, hue] =
            part.shader_weights([weights[0] as f32, weights[1] as f32, weights[2] as f32, 0.0]);
        let job = json!({
            "shader": shader, "sines": buffers.sines, "inverse": buffers.inverse, "corners": buffers.corners, "random": buffers.random,
            "directions": looks,
            "header": {
                "lightness": lightness, "hue": hue, "inverse_index": 1.0 / 1.5, "texel_mm": TEXEL_MM, "counts": buffers.counts,
                "side": buffers.side, "paints": buffers.paints, "paths": buffers.paths,
            },
        });
        let Some(found) = run(folder.path(), &job) else { return };
        gonio_tests::say(&format!("WGSL flakes ran on {}, {}", found["device"], part.name()));
        let mixed = m.mix(&weights, part).expect("mixed").paint;
        let flakes = mixed.parts().flakes.as_ref().expect("flakes");
        let values: Vec<[f64; 3]> = serde_json::from_value(found["flakes"].clone()).expect("colours");
        assert_eq!(values.len(), looks.len());
        let off = looks.iter().zip(&values).filter(|(look, theirs)| {
            let [a, b, c, d, e, f, x, y] = **look;
            let place = mixed.inside(Vec3::new(a, b, c), Vec3::new(d, e, f)).expect("above").place;
            let ours = flakes.at(place, [x, y]);
            let size = ours.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            (0..3).any(|k| (ours[k] - theirs[k]).abs() > 2e-4 * size + 1e-6)
        });
        // a texel whose change-over falls on the last bit of an angle may show the neighbouring slice
        let off = off.count();
        assert!(off <= looks.len() / 500, "{}: {off} of {} differ", part.name(), looks.len());
    }
}

fn run(folder: &Path, job: &serde_json::Value) -> Option<serde_json::Value> {
    let path = folder.join("job.json");
    std::fs::write(&path, job.to_string()).expect("written");
    let interpreter = std::env::var_os("GONIO_PYTHON").unwrap_or_else(|| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/flake_shaders.py");
    let output = Command::new(interpreter).arg(script).arg(&path).output().ok()?;
    let said = String::from_utf8_lossy(&output.stderr);
    if output.status.code() == Some(77) {
        gonio_tests::say(&format!("WGSL flakes did not run: {}", said.trim()));
        return None;
    }
    assert!(output.status.success(), "{said}");
    Some(serde_json::from_slice(&output.stdout).expect("one JSON object"))
}
