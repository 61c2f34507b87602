//! Samples that look different when turned: found out, kept over four angles, evaluated; and samples that do not.

use gonio_brdf::Brdf as _;
use gonio_brdf::formats::{self, netcdf};
use gonio_brdf::models::AshikhminShirleyAnisotropic;
use gonio_brdf::{Anisotropic, Flag, Meaning};
use gonio_optics::{Angle, Geometry, Vec3, colour};

use crate::command::Bench;
use crate::radiometry::{MATRIX, SENSOR, chart};

const BRUSHED: &str = r#"{"model":"ashikhmin-shirley-anisotropic","diffuse":[0.1,0.15,0.2],"specular":[0.5,0.5,0.45],"exponent_u":12.0,"exponent_v":4.0,"r0":0.5}"#;
const PLAIN: &str = r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.3,0.2,0.1],"specular":[0.1,0.1,0.1],"exponent":12.0}"#;
const SPINS: &str = "format = \"gonio-plan\"\nversion = 1\ntilt_deg = [0, 20, 40, 60]\nspin_deg = [0, 45, 90, 135, 180, 225, 270, 315]\n";

fn scan(truth: &str, name: &str, more: &[&str]) -> (Bench, serde_json::Value) {
    let bench = Bench::new();
    bench.write("truth.json", truth);
    bench.write("spins.toml", SPINS);
    let words =
        ["scan", "--instrument", "tiny", "--truth", "truth.json", "-o", name, "--fit=lambert", "--json"];
    let told = bench.ok(&[&words[..], more].concat()).json();
    (bench, told)
}

/// The truth of [`BRUSHED`].
const TRUTH: AshikhminShirleyAnisotropic = AshikhminShirleyAnisotropic {
    diffuse: [0.1, 0.15, 0.2],
    specular: [0.5, 0.5, 0.45],
    exponent_u: 12.0,
    exponent_v: 4.0,
    r0: 0.5,
};

/// Mean colour difference from the truth, which the light meets at the azimuth that the table says; the same turned the wrong way round; over how many cells.
fn apart(table: &Anisotropic) -> [f64; 3] {
    let polar = |theta: f64, phi: f64| Vec3::from_polar(Angle::from_degrees(theta), Angle::from_degrees(phi));
    let (mut sum, mut mirrored, mut n) = (0.0, 0.0, 0.0);
    for at in (0..table.values.len()).filter(|&at| table.flag[at] == Flag::Measured) {
        let (pi, rest) = (at / table.grid.len(), at % table.grid.len());
        let [ti, to, p] = table.grid.coordinates(rest);
        // the tiny instrument's pixels are wide at grazing view, and a node is not a bin
        if to == 0 || table.grid.theta_o_deg[to] > 60.0 {
            continue;
        }
        let off = |phi_i: f64| {
            let l = polar(table.grid.theta_i_deg[ti], phi_i);
            let v = polar(table.grid.theta_o_deg[to], phi_i + table.grid.phi_deg[p]);
            let lab = |f: [f64; 3]| colour::lab_from_brdf(f);
            let d = colour::ciede2000(lab(table.values[at].map(f64::from)), lab(TRUTH.eval(l, v)));
            (d, Geometry::from_directions(l, v).from_mirror().degrees())
        };
        let (d, from_mirror) = off(table.phi_i_deg[pi]);
        if from_mirror > 15.0 {
            sum += d;
            mirrored += off(-table.phi_i_deg[pi]).0;
            n += 1.0;
        }
    }
    [sum / n, mirrored / n, n]
}

#[test]
fn an_imperfect_instrument_sees_a_brushed_sample_as_it_is_once_calibrated() {
    let bench = Bench::new();
    bench.write("truth.json", BRUSHED);
    bench.write("spins.toml", SPINS);
    bench.write("m.toml", SENSOR);
    let virtual_one = ["scan", "--instrument", "tiny", "--misalignment", "m.toml", "--truth", "truth.json"];
    for kind in ["flat", "white", "black", "trap"] {
        bench.ok(&[&virtual_one[..], &["--kind", kind, "-o", &format!("{kind}.mcap")]].concat());
    }
    bench.ok(&[&virtual_one[..], &["--plan", "spins.toml", "-o", "S.mcap"]].concat());
    let sessions = ["flat.mcap", "white.mcap", "black.mcap", "trap.mcap"];
    bench.ok(&[&["calibrate", "radiometry", "-o", "I.toml"], &sessions[..]].concat());
    chart(&bench, "chart.toml");
    bench
        .ok(&[&["calibrate", "radiometry", "-o", "C.toml", "--chart", "chart.toml"], &sessions[..]].concat());
    let table = |name: &str, instrument: &[&str]| {
        let output = format!("{name}.nc");
        bench.ok(&[&["replay", "S.mcap", "--reference", "white.mcap", "-o", &output], instrument].concat());
        netcdf::read_anisotropic(&bench.read(&format!("{name}.azimuths.nc"))).expect("a table")
    };
    let (plain, calibrated) = (table("plain", &[]), table("calibrated", &["--instrument", "I.toml"]));
    let [[before, ..], [after, ..]] = [apart(&plain), apart(&calibrated)];
    gonio_tests::say(&format!(
        "a brushed sample over four angles: ΔE {before:.3} as described, {after:.3} calibrated"
    ));
    // most of either is noise and what bins as wide as tiny's pixels average over: the level below is the sharper test
    assert!(after < 0.6 && after < before, "{before} {after}");
    // within the stated uncertainty, which knows of κ: face and glare make the plain one too bright
    let excess = |t: &Anisotropic| {
        let polar =
            |theta: f64, phi: f64| Vec3::from_polar(Angle::from_degrees(theta), Angle::from_degrees(phi));
        let (mut ratio, mut n) = (0.0, 0.0);
        for at in (0..t.values.len()).filter(|&at| t.flag[at] == Flag::Measured) {
            let [ti, to, p] = t.grid.coordinates(at % t.grid.len());
            let phi_i = t.phi_i_deg[at / t.grid.len()];
            let (l, v) = (
                polar(t.grid.theta_i_deg[ti], phi_i),
                polar(t.grid.theta_o_deg[to], phi_i + t.grid.phi_deg[p]),
            );
            if to > 0
                && t.grid.theta_o_deg[to] <= 60.0
                && Geometry::from_directions(l, v).from_mirror().degrees() > 15.0
            {
                ratio += f64::from(t.values[at][1]) / TRUTH.eval(l, v)[1] - 1.0;
                n += 1.0;
            }
        }
        ratio / n
    };
    let (before, after) = (excess(&plain), excess(&calibrated));
    gonio_tests::say(&format!(
        "green too large by {:.3} % as described, {:.3} % calibrated",
        100.0 * before,
        100.0 * after
    ));
    assert!(after.abs() < 0.004 && after.abs() < 0.5 * before.abs(), "{before} {after}");
    // the matrix of a chart, and what the table says of it
    let coloured = table("coloured", &["--instrument", "C.toml"]);
    assert!(
        coloured.attributes["conventions"].contains("Rec. 709")
            && coloured.attributes.contains_key("colour_delta_e_max")
    );
    assert!(calibrated.attributes["conventions"].contains("camera's channels"));
    for at in (0..coloured.values.len()).filter(|&at| coloured.flag[at] == Flag::Measured).step_by(101) {
        let seen = calibrated.values[at].map(f64::from);
        for (c, row) in MATRIX.iter().enumerate() {
            let wanted = row[0] * seen[0] + row[1] * seen[1] + row[2] * seen[2];
            assert!(
                (f64::from(coloured.values[at][c]) - wanted).abs() < 2e-3 * wanted.abs().max(0.01),
                "{at} {c}"
            );
        }
    }
}

#[test]
fn a_brushed_sample_is_found_out_and_its_table_holds_four_angles() {
    let (bench, told) = scan(BRUSHED, "S.mcap", &["--plan", "spins.toml"]);
    assert_eq!(told["isotropy"]["verdict"], "anisotropic", "{}", told["isotropy"]);
    let table = netcdf::read_anisotropic(&bench.read("S.azimuths.nc")).expect("a table over four angles");
    assert_eq!(table.phi_i_deg.len(), 8);
    assert!(matches!(table.meaning, Meaning::CellMean { .. }));
    // the same from the session alone, bit for bit
    bench.ok(&["replay", "S.mcap", "-o", "again.nc", "--reference", "S.white.mcap"]);
    assert_eq!(bench.read("again.azimuths.nc"), bench.read("S.azimuths.nc"));
    let [mean, mirrored, n] = apart(&table);
    assert!(
        n > 10_000.0 && mean < 0.6 && mirrored > 2.0 * mean,
        "mean {mean}, turned the other way {mirrored}, over {n}"
    );
    // and it is what other commands open: turned by a quarter, the light meets the brush across
    bench.write("g.csv", "theta_i_deg,theta_o_deg,phi_deg,phi_i_deg\n60,10,0,0\n60,10,0,90\n");
    bench.ok(&["eval", "S.azimuths.nc", "--geometries", "g.csv", "-o", "out.csv"]);
    let text = String::from_utf8(bench.read("out.csv")).expect("text");
    let reds: Vec<f64> = text
        .lines()
        .skip(1)
        .map(|l| l.split(',').nth(4).and_then(|v| v.parse().ok()).expect("red"))
        .collect();
    assert!(
        text.starts_with("theta_i_deg,theta_o_deg,phi_deg,phi_i_deg,r,g,b\n") && reds.len() == 2,
        "{text}"
    );
    assert!((reds[0] / reds[1] - 1.0).abs() > 0.05, "{text}");
    assert!(matches!(formats::open(&bench.path("S.azimuths.nc")), Ok(formats::Loaded::Function(_))));
    let info = bench.ok(&["info", "S.azimuths.nc"]);
    assert!(info.stdout.contains("azimuths of light: 8"), "{}", info.stdout);
}

#[test]
fn a_plain_sample_is_isotropic_and_has_no_such_table() {
    let (bench, told) = scan(PLAIN, "S.mcap", &["--plan", "spins.toml"]);
    assert_eq!(told["isotropy"]["verdict"], "isotropic", "{}", told["isotropy"]);
    assert!(told["isotropy"]["table"].is_null() && !bench.path("S.azimuths.nc").exists());
}

#[test]
fn one_spin_of_a_brushed_sample_askew_is_no_verdict_but_a_hint() {
    let (_, told) = scan(BRUSHED, "S.mcap", &[]);
    let sentence = told["isotropy"]["sentence"].as_str().expect("a sentence");
    // at spin 0 the brush lies in the plane of incidence: both sides agree, and nothing else can be told
    assert!(sentence.contains("two sides"), "{sentence}");
}
