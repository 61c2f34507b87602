//! What the files say and what renderers make of it; Mitsuba itself is asked in the stories.

use gonio_optics::{Geometry, Vec3, quadrature::gauss_legendre};

use super::*;

fn model(text: &str) -> ModelFile {
    ModelFile::from_json(text).unwrap()
}

const SIMPLIFIED: &str = r#"{"model":"ashikhmin-shirley-simplified","diffuse":[0.1,0.2,0.3],"specular":[0.05,0.04,0.02],"exponent":120}"#;
const GGX: &str =
    r#"{"model":"ggx","diffuse":[0.1,0.2,0.3],"lobes":[{"specular":[0.9,0.8,0.7],"alpha":0.2,"r0":0.05}]}"#;
const THREE: &str = r#"{"model":"cook-torrance","diffuse":[0.1,0.2,0.3],"lobes":[{"specular":[0.2,0.2,0.1],"alpha":0.1,"r0":0.1},{"specular":[0.1,0.1,0.2],"alpha":0.3,"r0":0.3},{"specular":[0.1,0,0],"alpha":0.5,"r0":1}]}"#;
const COATED: &str = r#"{"model":"lambert","diffuse":[0.4,0.3,0.2],"coat":{"index":1.5}}"#;

fn exported(text: &str, renderer: Renderer) -> Export {
    export(&model(text), renderer, "my paint").unwrap()
}

fn refused(text: &str, renderer: Renderer) -> String {
    export(&model(text), renderer, "x").unwrap_err().to_string()
}

#[test]
fn sopps_conversion_loses_nothing_and_its_shader_gives_the_model_back() {
    let e = exported(SIMPLIFIED, Renderer::Sopp);
    let row = e.text.lines().last().unwrap();
    // Rs = max cs, cs/Rs, cd/(1 − Rs)
    let numbers: Vec<f64> = row.split(',').skip(1).map(|x| x.parse().unwrap()).collect();
    let want = [0.0, 120.0, 0.1 / 0.95, 0.2 / 0.95, 0.3 / 0.95, 1.0, 0.8, 0.4, 0.05];
    for (got, want) in numbers.iter().zip(want) {
        assert!((got - want).abs() < 1e-6, "{row}");
    }
    assert!(row.starts_with("my_paint,") && e.text.starts_with("# "));
    assert!(e.loss.within_15_deg.max < 1e-9 && e.loss.beyond_15_deg.max < 1e-9, "{:?}", e.loss);
    let bright = SIMPLIFIED.replace("0.05,", "1.2,");
    assert!(refused(&bright, Renderer::Sopp).contains("1.2"));
    assert!(refused(GGX, Renderer::Sopp).contains("fit ashikhmin-shirley"));
}

#[test]
fn a_lambertian_is_the_same_everywhere() {
    let text = r#"{"model":"lambert","diffuse":[0.4,0.3,0.2]}"#;
    for (name, renderer) in Renderer::ALL {
        let loss = exported(text, renderer).loss;
        assert!(loss.beyond_15_deg.max < 1e-9 && loss.within_15_deg.max < 1e-9, "{name}: {loss}");
    }
    // and under a coat, where Mitsuba's plastic is our coat without inter-reflection
    assert!(exported(COATED, Renderer::Mitsuba).loss.beyond_15_deg.max < 1e-9);
}

#[test]
fn the_loss_is_told_in_every_file() {
    for (name, renderer) in [Renderer::Mitsuba, Renderer::MaterialX, Renderer::Gltf].map(|r| (r.name(), r)) {
        let e = exported(GGX, renderer);
        assert!(e.text.contains(&e.loss.to_string()), "{name}: {}", e.text);
        // a GGX lobe of moderate width keeps its look: what is lost is at grazing angles
        assert!(e.loss.beyond_15_deg.mean < 2.0, "{name}: {}", e.loss);
    }
}

#[test]
fn what_does_not_map_says_what_would() {
    for renderer in [Renderer::Mitsuba, Renderer::MaterialX, Renderer::Gltf] {
        let phong = r#"{"model":"phong","diffuse":[0.1,0.1,0.1],"specular":[0.1,0.1,0.1],"exponent":20}"#;
        let m = refused(phong, renderer);
        assert!(m.contains("\"phong\"") && m.contains("fit cook-torrance"), "{m}");
    }
    assert!(refused(THREE, Renderer::Gltf).contains("3 lobes"));
    exported(THREE, Renderer::Mitsuba);
    let coated = GGX.replace("}]}", "}],\"coat\":{\"index\":1.5}}");
    assert!(refused(&coated, Renderer::Mitsuba).contains("materialx or gltf"));
    let bright = SIMPLIFIED.replace("[0.1,0.2,0.3]", "[0.99,0.99,0.99]");
    assert!(refused(&bright, Renderer::Mitsuba).contains("1.040"));
}

/// ∫ f cos over the hemisphere of lights.
fn albedo(brdf: &dyn Brdf, view: Vec3) -> f64 {
    let nodes = gauss_legendre(48);
    let mut sum = 0.0;
    for (x, w) in &nodes {
        let mu = *x;
        let s = (1.0 - mu * mu).sqrt();
        for (y, u) in &nodes {
            let phi = std::f64::consts::TAU * y;
            let light = Vec3::new(s * phi.cos(), s * phi.sin(), mu);
            sum += brdf.eval(light, view)[0] * mu * w * std::f64::consts::TAU * u;
        }
    }
    sum
}

#[test]
fn the_albedo_of_a_lobe_by_its_lattice_is_the_integral_of_what_is_rendered() {
    // a white lobe of F = 1 over black: MaterialX compensates it to give back everything
    let text = r#"{"model":"ggx","diffuse":[0,0,0],"lobes":[{"specular":[1,1,1],"alpha":0.5,"r0":0.3}]}"#;
    let e = exported(text, Renderer::MaterialX);
    let layers = smith::Albedo::new(0.5, 0.3);
    for theta in [0.0f64, 30.0, 60.0] {
        let (_, view) = Geometry::from_degrees(0.0, theta, 0.0).directions();
        let (got, plain) = (albedo(e.rendered.as_ref(), view), layers.at(view.z));
        // compensated: above the plain albedo, by less than what a white lobe would lose
        assert!(got > plain && got < plain * 1.25, "{theta}: {got} against {plain}");
    }
}

#[test]
fn light_that_comes_back_at_45_degrees_is_as_much_as_the_models() {
    let e = exported(GGX, Renderer::MaterialX);
    let (_, view) = Geometry::from_degrees(0.0, 45.0, 0.0).directions();
    let ours = albedo(&model(GGX), view);
    let theirs = albedo(e.rendered.as_ref(), view);
    assert!((ours / theirs - 1.0).abs() < 0.05, "{ours} {theirs}");
}

#[test]
fn gltf_is_json_with_the_extensions_it_names() {
    let coated = GGX.replace("}]}", "}],\"coat\":{\"index\":1.5}}");
    let json: serde_json::Value = serde_json::from_str(&exported(&coated, Renderer::Gltf).text).unwrap();
    assert_eq!(json["asset"]["version"], "2.0");
    let material = &json["materials"][0];
    for used in json["extensionsUsed"].as_array().unwrap() {
        assert!(material["extensions"][used.as_str().unwrap()].is_object(), "{used}");
    }
    assert_eq!(material["extensions"]["KHR_materials_clearcoat"]["clearcoatFactor"], 1.0);
    let base = material["pbrMetallicRoughness"]["baseColorFactor"].as_array().unwrap();
    assert!(base.len() == 4 && base.iter().all(|x| (0.0..=1.0).contains(&x.as_f64().unwrap())));
}
