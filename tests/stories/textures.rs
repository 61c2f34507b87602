//! Car paints and their flakes: recorded by the texture camera, replayed, fitted, rendered.

use std::path::Path;
use std::sync::Arc;

use gonio_acquisition::texture::{TextureReducer, TextureWhiteBuilder};
use gonio_acquisition::{Options, PixelMap};
use gonio_brdf::formats::netcdf;
use gonio_brdf::{Grid, Measured, ModelFile};
use gonio_instrument::{Misalignment, Pose, builtin};
use gonio_optics::Vec3;
use gonio_paint::btf_folder::read_btf_folder;
use gonio_recording::Session;
use gonio_sim::flakes::{Field, FlakePaint};
use gonio_sim::optics::{Sample, VirtualOptics};

use crate::command::Bench;

const SILVER: &str = r#"
format = "gonio-flake-paint"
version = 1
name = "silver"
seed = 11
coat_index = 1.5
diffuse = [0.03, 0.04, 0.06]
tile_mm = 4.0
texel_mm = 0.02

[[flakes]]
density_per_mm2 = 500.0
size_mm = 0.03
size_spread = 0.3
spread_deg = 8.0
depth_mm = [0.002, 0.03]
reflectance = [0.85, 0.86, 0.88]

[[flakes]]
density_per_mm2 = 100.0
size_mm = 0.04
spread_deg = 5.0
depth_mm = [0.005, 0.02]
reflectance = [1.0, 1.0, 1.0]
film_nm = 90.0
film_spread_nm = 8.0
"#;

/// A row of a table of published paints.
const GUENTHER: &str = "# made up\nname,kd_r,kd_g,kd_b,ks1_r,ks1_g,ks1_b,ks2_r,ks2_g,ks2_b,ks3_r,ks3_g,ks3_b,R1,R2,R3,M1,M2,M3\n\
    night,0.01,0.02,0.1,0.004,0.005,0.006,0.02,0.02,0.03,0.005,0.006,0.007,0.9,0.2,0.2,0.3,0.15,0.05\n";

const SCENE: &str = r#"
format = "gonio-scene"
version = 1
name = "ball"
size = [48, 48]
samples = 4

[camera]
from = [0, 0, 4]
to = [0, 0, 0]
field_of_view_deg = 32

[object]
shape = "sphere"

[[light]]
kind = "directional"
towards = [0.5, 0.5, 1.0]
"#;

fn scanned() -> Bench {
    let bench = Bench::new();
    bench.write("silver.toml", SILVER);
    bench.ok(&["scan", "--texture", "--instrument", "tiny", "--truth", "silver.toml", "-o", "S.mcap"]);
    bench
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn a_texture_scan_is_replayed_to_the_bit_and_shows_the_flakes_that_are_there() {
    let bench = scanned();
    // the slices again, from the session alone
    let told = bench.ok(&["replay", "S.mcap", "-o", "again", "--json"]).json();
    let (first, again) = (bench.path("S.textures"), bench.path("again"));
    assert_eq!(names(&first), names(&again));
    for name in names(&first) {
        let read = |folder: &Path| std::fs::read(folder.join(&name)).expect("a file");
        assert_eq!(read(&first), read(&again), "{name}");
    }
    let textures = &told["textures"];
    let number = |key: &str| textures[key].as_f64().expect("a number");
    assert!(number("off_max_deg") <= 1.5 && number("covered") > number("filled"), "{textures}");
    let folder = read_btf_folder(&first).expect("slices");
    assert!(folder.btf.half().len() >= 4 && folder.btf.incidence().len() >= 4, "{textures}");
    assert_eq!((folder.btf.size(), folder.texel_mm, folder.coat_index), ([32, 32], 0.02, Some(1.5)));

    // against the simulator's own texels, head by head
    let session = Session::open(&bench.path("S.mcap")).expect("a session");
    let white = Session::open(&bench.path("S.white.mcap")).expect("a session");
    let instrument = session.instrument().expect("an instrument");
    let map = Arc::new(PixelMap::new(&instrument));
    let certificate = white.certificate().expect("readable").expect("a certificate");
    let mut builder = TextureWhiteBuilder::new(
        &map,
        &Options::default(),
        ModelFile::from_json(&certificate.brdf).expect("a model"),
    );
    for pose in white.poses() {
        builder.add(&pose.expect("whole")).expect("a white pose");
    }
    let mut reducer =
        TextureReducer::new(&map, &Options::default(), builder.finish().expect("a white"), Some(1.5))
            .expect("heads");
    let field = Field::new(FlakePaint::from_toml(SILVER).expect("readable")).expect("sound");
    let heads = &instrument.textures().expect("a texture camera").heads_deg;
    let (mut compared, mut correlations) = (0, Vec::new());
    for pose in session.poses() {
        let record = pose.expect("whole");
        let tilt = record.commanded.tilt.degrees();
        for slice in reducer.add(&record).expect("a pose") {
            // the light stands at the tilt, a head at the tilt less its angle from the lamp, both in the plane of tilting
            let at = |deg: f64| Vec3::new(deg.to_radians().sin(), 0.0, deg.to_radians().cos());
            let (l, v) = (at(tilt), at(tilt - heads[slice.head]));
            let k = (1.0 - gonio_optics::fresnel::dielectric(l.z, 1.5))
                * (1.0 - gonio_optics::fresnel::dielectric(v.z, 1.5))
                / 2.25;
            // F1 lies 3 mm, 150 texels, off the spin axis
            let texels = field.texels([150 - 16, field.side() - 16], [32, 32], l, v);
            let expected: Vec<f64> = texels.iter().map(|t| f64::from(t[1]) / k).collect();
            let found: Vec<f64> = slice.texels.iter().map(|t| f64::from(t[1])).collect();
            let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
            let (me, mf) = (mean(&expected), mean(&found));
            // looked at from the side a pixel spans several texels, and those beyond the raster
            if me < 0.05 || v.z < 0.5 {
                continue;
            }
            assert!((mf / me - 1.0).abs() < 0.06, "tilt {tilt} head {}: {mf} {me}", slice.head);
            let product = |a: &[f64], b: &[f64], ma: f64, mb: f64| {
                a.iter().zip(b).map(|(x, y)| (x - ma) * (y - mb)).sum::<f64>()
            };
            let r = product(&expected, &found, me, mf)
                / (product(&expected, &expected, me, me) * product(&found, &found, mf, mf)).sqrt();
            correlations.push(r);
            compared += 1;
        }
    }
    correlations.sort_by(f64::total_cmp);
    let median = correlations[correlations.len() / 2];
    assert!(compared > 40 && median > 0.8, "{compared} slices, correlation {median}");
}

#[test]
fn a_texture_scan_that_makes_no_sense_says_so() {
    let bench = Bench::new();
    bench.write("silver.toml", SILVER);
    let ran = bench.run(&["scan", "--texture", "--fit", "--instrument", "tiny", "-o", "S.mcap"]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    bench.write("broken.toml", SILVER.replace("spread_deg = 8.0", "spread_deg = 80.0"));
    let ran =
        bench.run(&["scan", "--texture", "--instrument", "tiny", "--truth", "broken.toml", "-o", "S.mcap"]);
    assert!(ran.code == 2 && ran.stderr.contains("flakes[0].spread_deg = 80"), "{}", ran.stderr);
    bench.ok(&["scan", "--instrument", "tiny", "-o", "plain.mcap"]);
    bench.ok(&["scan", "--kind", "white", "--instrument", "tiny", "-o", "plain.white.mcap"]);
    bench.ok(&["scan", "--texture", "--kind", "white", "--instrument", "tiny", "-o", "W.mcap"]);
    let ran = bench.run(&["replay", "W.mcap", "--reference", "plain.white.mcap", "-o", "x"]);
    assert!(ran.code == 2 && ran.stderr.contains("camera"), "{}", ran.stderr);
}

#[test]
fn the_main_camera_sees_other_flakes_at_each_spin_and_the_mean_over_them() {
    let d = builtin::description("tiny").expect("known").expect("readable");
    let optics = VirtualOptics::new(&d, &Misalignment::default());
    let field = Arc::new(Field::new(FlakePaint::from_toml(SILVER).expect("readable")).expect("sound"));
    let flakes = Sample::flakes(&field);
    let mut mean = Sample::flakes(&field);
    mean.flakes = None;
    let spins = 6;
    let smooth = optics.rate_map(Pose::from_degrees(25.0, 0.0), 0.0, &mean).rates;
    let lit: Vec<usize> = (0..smooth.len()).filter(|&p| smooth[p] > 0.0).collect();
    let mut sums = vec![0.0f64; smooth.len()];
    let mut spread = 0.0;
    for s in 0..spins {
        let rates = optics.rate_map(Pose::from_degrees(25.0, 60.0 * f64::from(s)), 0.0, &flakes).rates;
        for &p in &lit {
            let ratio = f64::from(rates[p]) / f64::from(smooth[p]);
            sums[p] += ratio / f64::from(spins);
            spread += (ratio - 1.0).powi(2);
        }
    }
    let n = lit.len() as f64;
    let one = (spread / (n * f64::from(spins))).sqrt();
    let averaged = (lit.iter().map(|&p| (sums[p] - 1.0).powi(2)).sum::<f64>() / n).sqrt();
    let level = lit.iter().map(|&p| sums[p]).sum::<f64>() / n;
    assert!(one > 0.01, "one spin departs by {one}");
    assert!(averaged < 0.7 * one, "the mean of {spins} by {averaged}, one by {one}");
    assert!((level - 1.0).abs() < 0.05, "{level}");
}

#[test]
fn a_paint_is_converted_told_of_fitted_and_rendered_with_its_flakes() {
    let bench = Bench::new();
    bench.write("published.csv", GUENTHER);
    bench.write("scene.toml", SCENE);
    bench.write("silver.toml", SILVER);
    bench.ok(&["convert", "published.csv#night", "night.paint"]);
    let info = bench.ok(&["info", "night.paint", "--json"]).json();
    assert_eq!(info["content"], "car-paint");
    assert_eq!(info["lobes"].as_array().map(Vec::len), Some(3));
    // the form of 1982 is four times the modern one
    assert!((info["lobes"][1]["specular"][0].as_f64().expect("a number") - 0.08).abs() < 1e-12);
    bench.write("g.csv", "theta_i_deg,theta_o_deg,phi_deg\n20,30,170\n45,10,0\n");
    bench.ok(&["eval", "night.paint", "--geometries", "g.csv", "-o", "a.csv"]);
    bench.ok(&["eval", "published.csv#night", "--geometries", "g.csv", "-o", "b.csv"]);
    assert_eq!(bench.read("a.csv"), bench.read("b.csv"));
    let ran = bench.run(&["convert", "published.csv#day", "day.paint"]);
    assert!(ran.code == 2 && ran.stderr.contains("night"), "{}", ran.stderr);
    bench.write("damaged.paint", &bench.read("night.paint")[..200]);
    let ran = bench.run(&["info", "damaged.paint"]);
    assert!(ran.code == 2 && ran.stderr.contains("damaged"), "{}", ran.stderr);

    bench.ok(&["scan", "--texture", "--instrument", "tiny", "--truth", "silver.toml", "-o", "T.mcap"]);
    bench.ok(&["convert", "night.paint", "night.nc"]);
    let ran =
        bench.run(&["fit", "night.nc", "--model", "car-paint", "--flakes", "T.textures", "-o", "x.paint"]);
    assert!(ran.code == 2 && ran.stderr.contains("say --coat 1.5"), "{}", ran.stderr);
    // the mean of the paint of the textures, measured without noise
    let field = Arc::new(Field::new(FlakePaint::from_toml(SILVER).expect("readable")).expect("sound"));
    let grid = Grid {
        theta_i_deg: (0..8).map(|k| 10.0 * f64::from(k)).collect(),
        theta_o_deg: (0..15).map(|k| 5.0 * f64::from(k)).collect(),
        phi_deg: (0..13).map(|k| 15.0 * f64::from(k)).collect(),
    };
    let table = netcdf::write(&Measured::sampled(grid, &field.mean())).expect("a table");
    bench.write("mean.nc", table);
    let words = ["fit", "mean.nc", "--model", "car-paint", "--coat", "1.5", "--json"];
    let error = |more: &[&str]| {
        let fit = bench.ok(&[&words[..], more].concat()).json();
        fit["fit"]["delta_e"]["beyond_15_deg"]["mean"].as_f64().expect("a number")
    };
    // 32 × 32 texels show too few flakes for their mean: brought to the level of the measurement they agree with it
    let (without, with) = (error(&[]), error(&["--flakes", "T.textures", "-o", "sparkling.paint"]));
    let kept = error(&["--flakes", "T.textures", "--keep-flake-level"]);
    assert!(
        without < 0.1 && with < 0.5 && with < 0.25 * kept,
        "{without} without flakes, {with} with their textures, {kept} with textures as they are"
    );
    let info = bench.ok(&["info", "sparkling.paint", "--json"]).json();
    assert_eq!(info["flakes"]["kind"], "slices");
    bench.ok(&["render", "sparkling.paint", "--scene", "scene.toml", "-o", "flakes.exr"]);
    bench.ok(&["render", "sparkling.paint", "--scene", "scene.toml", "--mm-per-unit", "0", "-o", "mean.exr"]);
    assert_ne!(bench.read("flakes.exr"), bench.read("mean.exr"));
    let ran = bench.run(&["trade", "no.paint", "-o", "t"]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
}
