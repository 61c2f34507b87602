//! Laws that cross rooms: every model file, averaged over the cells of Sopp's grid as a measurement would, is finite, not negative and reciprocal.

use gonio_brdf::{Brdf, Grid, Meaning, ModelFile, average::model_cell_mean};
use gonio_optics::{Angle, Geometry};

/// One file of every model, sharp and broad, bare and coated.
fn files() -> Vec<ModelFile> {
    let mut out = Vec::new();
    for exponent in ["0", "21", "1300", "1e6"] {
        let lobe = format!(r#""diffuse":[0.2,0.1,0.05],"specular":[0.3,0.3,0.3],"exponent":{exponent}"#);
        for name in ["phong", "blinn-phong", "ashikhmin-shirley-simplified", "lambert-ashikhmin-shirley"] {
            out.push(format!(r#"{{"model":"{name}",{lobe}}}"#));
        }
        out.push(format!(r#"{{"model":"ashikhmin-shirley",{lobe},"r0":0.04,"coat":{{"index":1.5}}}}"#));
    }
    for alpha in ["1e-4", "0.05", "0.6"] {
        out.push(format!(
            r#"{{"model":"cook-torrance","diffuse":[0.2,0.1,0.05],"lobes":[{{"specular":[0.3,0.3,0.3],"alpha":{alpha},"r0":0.1}}],"coat":{{"index":1.5}}}}"#
        ));
        let lobe = format!(r#""specular":[0.3,0.3,0.3],"alpha":{alpha}"#);
        out.push(format!(
            r#"{{"model":"ggx","diffuse":[0.2,0.1,0.05],"lobes":[{{{lobe},"r0":0.1}}],"coat":{{"index":1.5}}}}"#
        ));
        for name in ["ward", "ward-duer"] {
            out.push(format!(r#"{{"model":"{name}","diffuse":[0.2,0.1,0.05],{lobe}}}"#));
        }
    }
    for (cxy, exponent) in [(-1.0, 0), (-0.9, 21), (0.7, 1300)] {
        out.push(format!(
            r#"{{"model":"lafortune","diffuse":[0.2,0.1,0.05],"lobes":[{{"specular":[0.3,0.3,0.3],"cxy":{cxy},"cz":0.95,"exponent":{exponent}}}]}}"#
        ));
    }
    for sigma in [0, 30, 90] {
        out.push(format!(
            r#"{{"model":"oren-nayar","diffuse":[0.2,0.1,0.05],"sigma_deg":{sigma},"coat":{{"index":1.5}}}}"#
        ));
    }
    out.iter().map(|text| ModelFile::from_json(text).unwrap()).collect()
}

#[test]
fn every_model_is_finite_and_reciprocal_over_the_whole_hemisphere() {
    for file in files() {
        for ti in 0..=18 {
            for to in 0..=18 {
                for phi in 0..=12 {
                    let g = Geometry::from_degrees(
                        5.0 * f64::from(ti),
                        5.0 * f64::from(to),
                        15.0 * f64::from(phi),
                    );
                    let (l, v) = g.directions();
                    let (a, b) = (file.eval(l, v)[0], file.eval(v, l)[0]);
                    assert!(a.is_finite() && a >= 0.0, "{} {g:?}: {a}", file.model.name());
                    assert!(
                        (a - b).abs() <= 1e-9 * a.abs().max(b.abs()),
                        "{} {g:?}: {a} {b}",
                        file.model.name()
                    );
                }
            }
        }
    }
}

#[test]
fn cell_means_at_the_horizon_and_at_the_mirror_direction_are_finite() {
    let grid = Grid::sopp();
    let lamp = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
    for file in files().iter().filter(|f| f.model.brdf().sharpness() < 1e5) {
        for cell in [[0, 0, 0], [6, 12, 35], [15, 30, 35], [18, 36, 35], [18, 36, 0], [18, 0, 0]] {
            let f = model_cell_mean(file, &grid, lamp, cell)[0];
            assert!(f.is_finite() && f >= 0.0, "{} {cell:?}: {f}", file.model.name());
        }
    }
}
