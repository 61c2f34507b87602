//! Real materials of other laboratories behave as what they are: white paper scatters evenly, paints shine at the mirror side, light and view can
//! be exchanged, nothing reflects more than it receives.

use std::f64::consts::PI;
use std::path::Path;

use gonio_brdf::formats::{self, Loaded};
use gonio_brdf::{Brdf, Grid, Rgb, Scattered};
use gonio_optics::Geometry;
use gonio_tests::real_data;

/// Azimuths at which light and view are exchanged.
const AROUND: [f64; 4] = [0.0, 60.0, 90.0, 120.0];

fn open(path: impl AsRef<Path>) -> Loaded {
    formats::open(path.as_ref()).unwrap_or_else(|e| panic!("{e}"))
}

fn at(brdf: &dyn Brdf, theta_i_deg: f64, theta_o_deg: f64, phi_deg: f64) -> Rgb {
    let (l, v) = Geometry::from_degrees(theta_i_deg, theta_o_deg, phi_deg).directions();
    brdf.eval(l, v)
}

/// ∫ f cos θo dω by a midpoint rule of 1° by 2°, the azimuths mirrored.
fn albedo(brdf: &dyn Brdf, theta_i_deg: f64) -> Rgb {
    let mut sum = [0.0; 3];
    for o in 0..90 {
        let theta_o_deg = f64::from(o) + 0.5;
        let (s, c) = theta_o_deg.to_radians().sin_cos();
        let weight = s * c * 1f64.to_radians() * 2.0 * 2f64.to_radians();
        for p in 0..90 {
            let f = at(brdf, theta_i_deg, theta_o_deg, 2.0 * f64::from(p) + 1.0);
            (0..3).for_each(|k| sum[k] += f[k] * weight);
        }
    }
    sum
}

/// The laws every reflectance obeys; `rough` is the relative difference allowed on exchange of light and view
/// at these azimuths.
fn obeys_the_laws(name: &str, brdf: &dyn Brdf, azimuths_deg: &[f64], rough: f64) {
    for theta_i_deg in [5.0, 30.0, 60.0] {
        let a = albedo(brdf, theta_i_deg);
        assert!(a.iter().all(|x| (0.0..=1.0).contains(x)), "{name}: albedo {a:?} at {theta_i_deg}");
    }
    // sums, not a mean of ratios: far from the lobe of a dark material the instrument's noise is as large as f
    let (mut differences, mut sums) = (0.0, 0.0);
    for (i, o) in [(10.0, 40.0), (20.0, 60.0), (35.0, 65.0), (15.0, 30.0)] {
        for &p in azimuths_deg {
            let (f, g) = (at(brdf, i, o, p), at(brdf, o, i, p));
            assert!(f.iter().chain(&g).all(|x| x.is_finite() && *x >= 0.0), "{name}: {f:?} {g:?}");
            let (f, g) = (f.iter().sum::<f64>(), g.iter().sum::<f64>());
            differences += (f - g).abs();
            sums += 0.5 * (f + g);
        }
    }
    assert!(
        differences / sums < rough,
        "{name}: exchange of light and view differs by {}",
        differences / sums
    );
}

/// φ = 180° is the mirror side: a paint is brighter there than on the light's side.
fn shines_at_the_mirror_side(name: &str, brdf: &dyn Brdf) {
    for theta_deg in [30.0, 45.0, 60.0] {
        let (mirror, light) = (at(brdf, theta_deg, theta_deg, 180.0), at(brdf, theta_deg, theta_deg, 0.0));
        assert!(
            mirror[1] > 3.0 * light[1],
            "{name}: {mirror:?} at the mirror side, {light:?} at the light's"
        );
    }
}

#[test]
fn rgl_white_paper_is_nearly_lambertian_and_wraps_shine() {
    let Some(data) = real_data("rgl_white_paper_is_nearly_lambertian_and_wraps_shine") else { return };
    let paper = open(data.file("rgl/paper_white_rgb.bsdf"));
    assert_eq!(paper.describe().name.as_deref(), Some("White A4 paper (160 gsm)"));
    let paper = paper.as_brdf().unwrap();
    obeys_the_laws("paper_white", paper, &AROUND, 0.05);
    for (i, o, p) in
        [(0.0, 45.0, 0.0), (45.0, 0.0, 0.0), (20.0, 40.0, 90.0), (30.0, 60.0, 45.0), (45.0, 45.0, 0.0)]
    {
        let r = at(paper, i, o, p).map(|f| PI * f);
        assert!((0.74..0.92).contains(&r[0]) && (0.74..0.92).contains(&r[1]), "R = {r:?} at {i} {o} {p}");
    }
    // the file gives eight angles of incidence: beside the plane of incidence the sharp lobe of the second wrap is interpolated too coarsely
    // between them for an exchange of light and view (factors up to 2.4)
    for (name, azimuths_deg) in [("satin_rosaline", &AROUND[..]), ("cc_ibiza_sunset", &[0.0, 180.0])] {
        let wrap = open(data.file(&format!("rgl/{name}_rgb.bsdf")));
        obeys_the_laws(name, wrap.as_brdf().unwrap(), azimuths_deg, 0.2);
        shines_at_the_mirror_side(name, wrap.as_brdf().unwrap());
    }
}

#[test]
fn networks_of_paints_obey_the_laws() {
    let Some(data) = real_data("networks_of_paints_obey_the_laws") else { return };
    let file = data.file("nbrdf/merl_nbrdf.f32");
    for name in ["blue-metallic-paint", "silver-metallic-paint", "gold-paint"] {
        let paint = open(format!("{}#{name}", file.display()));
        obeys_the_laws(name, paint.as_brdf().unwrap(), &AROUND, 0.1);
        shines_at_the_mirror_side(name, paint.as_brdf().unwrap());
    }
    let missing =
        formats::open(format!("{}#no-such-paint", file.display()).as_ref()).unwrap_err().to_string();
    assert!(missing.contains("no-such-paint") && missing.contains("100 in all"), "{missing}");
}

#[test]
fn the_measured_base_coat_is_a_table_with_its_faults_kept() {
    let Some(data) = real_data("the_measured_base_coat_is_a_table_with_its_faults_kept") else { return };
    let loaded = open(data.file("mbsdf/carpaint_blue.mbsdf"));
    let table = loaded.to_measured(&Grid::sopp()).unwrap();
    assert_eq!(table.grid.shape(), [45, 45, 90]);
    assert!(table.values.iter().flatten().any(|&f| f < 0.0), "negative values are data and stay");
    shines_at_the_mirror_side("carpaint_blue", &table);
    let a = albedo(&table, 45.0);
    assert!(a[2] > a[0] && a[2] < 1.0, "a blue paint, {a:?}");
}

#[test]
fn cornell_paints_have_their_lobe_at_the_mirror_side_and_their_colour() {
    let Some(data) = real_data("cornell_paints_have_their_lobe_at_the_mirror_side_and_their_colour") else {
        return;
    };
    let load = |name: &str| -> Scattered {
        let Loaded::Scattered(s) = open(data.file(&format!("cornell/{name}.brdf"))) else {
            panic!("{name} is scattered")
        };
        assert_eq!(s.points.len(), 1439);
        s
    };
    for name in ["cayman", "krylon_blue"] {
        let s = load(name);
        let brightest = s.points.iter().max_by(|a, b| a.value[1].total_cmp(&b.value[1])).unwrap();
        assert!(brightest.geometry.from_mirror().degrees() < 3.0, "{name}: {:?}", brightest.geometry);
    }
    let blue = load("krylon_blue");
    let diffuse: Vec<_> = blue.points.iter().filter(|p| p.geometry.from_mirror().degrees() > 40.0).collect();
    let mean = [0, 1, 2].map(|c| diffuse.iter().map(|p| p.value[c]).sum::<f64>() / diffuse.len() as f64);
    assert!(mean[2] > 2.0 * mean[0] && mean[2] < 1.0 / PI, "an enamel that is blue: {mean:?}");
}
