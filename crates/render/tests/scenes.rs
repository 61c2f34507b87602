//! Scenes whose pictures are known: the white furnace, one light on a ball, energy that bounces, environments against sums over all directions.

use gonio_brdf::models::{AshikhminShirleySimplified, Lambert};
use gonio_brdf::{Brdf, Coat};
use gonio_optics::Vec3;
use gonio_render::scene::SceneFile;
use gonio_render::sphere::{self, Light, Sphere};
use gonio_render::trace::{Paint, RenderOptions, gather, render};
use gonio_render::{Scene, SceneError};

fn scene(body: &str) -> Scene {
    let text = format!("format = \"gonio-scene\"\nversion = 1\n{body}");
    let file = SceneFile::from_toml(&text, "test").unwrap_or_else(|e| panic!("{e}"));
    Scene::build(&file, std::path::Path::new(".")).unwrap_or_else(|e| panic!("{e}"))
}

fn picture(scene: &Scene, brdf: &dyn Brdf, options: RenderOptions<'_>) -> sphere::LinearImage {
    render(scene, &scene.views[0], Paint { brdf, gloss: None }, options).unwrap()
}

const FRONT: &str = "camera = { from = [0, 0, 6], height = 2.2 }\n";

#[test]
fn a_white_body_in_a_white_furnace_cannot_be_seen() {
    let white = Lambert { diffuse: [1.0; 3] };
    // convex bodies: straight light is all there is
    for shape in ["sphere", "egg", "capsule"] {
        let s = scene(&format!(
            "size = [24, 24]\nsamples = 400\n{FRONT}object = {{ shape = \"{shape}\" }}\n[[light]]\nkind = \"environment\"\nsky = \"uniform\"\n"
        ));
        let image = picture(&s, &white, RenderOptions::default());
        for (v, c) in image.values.iter().zip(&image.coverage) {
            assert!(*c < 0.99 || v.iter().all(|x| (x - 1.0).abs() < 0.03), "{shape}: {v:?}");
        }
        let inner: Vec<f32> =
            image.values.iter().zip(&image.coverage).filter(|p| *p.1 > 0.99).map(|p| p.0[1]).collect();
        let mean = inner.iter().sum::<f32>() / inner.len() as f32;
        assert!(inner.len() > 100 && (mean - 1.0).abs() < 2e-3, "{shape} {mean}");
    }
}

#[test]
fn light_that_bounces_in_a_box_is_not_lost() {
    let white = Lambert { diffuse: [1.0; 3] };
    // a box without a lid, seen from above; faces share no corner, so that their normals are their own
    let dir = tempfile::tempdir().unwrap();
    let (mut text, mut faces) = (String::new(), String::new());
    let walls = [
        [[-1, -1, -1], [-1, -1, 1], [1, -1, 1], [1, -1, -1]],
        [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]],
        [[-1, -1, 1], [-1, 1, 1], [1, 1, 1], [1, -1, 1]],
        [[-1, -1, -1], [-1, 1, -1], [-1, 1, 1], [-1, -1, 1]],
        [[1, -1, -1], [1, -1, 1], [1, 1, 1], [1, 1, -1]],
    ];
    for (k, wall) in walls.iter().enumerate() {
        for [x, y, z] in wall {
            text += &format!("v {x} {y} {z}\n");
        }
        faces += &format!("f {} {} {} {}\n", 4 * k + 1, 4 * k + 2, 4 * k + 3, 4 * k + 4);
    }
    std::fs::write(dir.path().join("box.obj"), text + &faces).unwrap();
    let scene = "format = \"gonio-scene\"\nversion = 1\nsize = [16, 16]\nsamples = 256\ncamera = { from = [0, 5, 0.01], height = 1.8 }\nobject = { mesh = \"box.obj\" }\n[[light]]\nkind = \"environment\"\nsky = \"uniform\"\n";
    let file = SceneFile::from_toml(scene, "box").unwrap();
    let s = Scene::build(&file, dir.path()).unwrap();
    let mean = |bounces: u32| {
        let image = picture(&s, &white, RenderOptions { bounces, ..RenderOptions::default() });
        assert!(image.coverage.iter().all(|c| *c == 1.0));
        image.values.iter().map(|v| v[0]).sum::<f32>() / image.values.len() as f32
    };
    let (none, many) = (mean(0), mean(60));
    // the walls shadow the floor; what they take they give back
    assert!(none < 0.6, "{none}");
    assert!((many - 1.0).abs() < 0.01, "{many}");
}

#[test]
fn a_ball_under_one_light_is_the_ball_of_the_closed_form() {
    let paint = AshikhminShirleySimplified { diffuse: [0.2, 0.1, 0.05], specular: [0.1; 3], exponent: 60.0 };
    let size = 48;
    let s = scene(&format!(
        "size = [{size}, {size}]\nsamples = 1\ncamera = {{ from = [0, 0, 6], height = {} }}\nobject = {{ shape = \"sphere\" }}\n[[light]]\nkind = \"directional\"\ntowards = [-0.8, 0.33, 0.5]\n",
        2.0 / sphere::RADIUS
    ));
    // many samples in the closed form, so that its grid and our random places agree
    let fine = scene_with_samples(s, 256);
    let image = picture(&fine, &paint, RenderOptions::default());
    let known = sphere::sphere(&paint, &Sphere { size, samples: 16, lights: vec![Light::aside()] });
    let mut compared = 0;
    for (i, (a, b)) in image.values.iter().zip(&known.values).enumerate() {
        if known.coverage[i] < 1.0 {
            continue;
        }
        compared += 1;
        for c in 0..3 {
            // theirs is π L over the irradiance
            let (x, y) = (f64::from(a[c]) * std::f64::consts::PI, f64::from(b[c]));
            assert!((x - y).abs() < 0.02 * y.max(0.05), "{i} {c}: {x} {y}");
        }
    }
    assert!(compared > 1000);
    assert!((fine.white() * std::f64::consts::PI - 1.0).abs() < 0.01, "{}", fine.white());
}

fn scene_with_samples(mut s: Scene, samples: u32) -> Scene {
    s.samples = samples;
    s
}

#[test]
fn the_gathered_geometries_make_the_same_picture() {
    let paint = AshikhminShirleySimplified { diffuse: [0.2, 0.1, 0.05], specular: [0.1; 3], exponent: 60.0 };
    let s = scene(
        "size = [40, 30]\nsamples = 4\ncamera = { from = [1, 1, 6], to = [0, 0, 0], field_of_view_deg = 24 }\nobject = { shape = \"teapot\", turntable = { to_deg = 360, steps = 3 } }\n\
         [[light]]\nkind = \"environment\"\nsky = \"studio\"\n[[light]]\nkind = \"directional\"\ntowards = [1, 2, 3]\n[[light]]\nkind = \"point\"\nposition = [-3, 2, 3]\nintensity = [4, 4, 4]\n",
    );
    assert_eq!(s.views.len(), 3);
    let gathered = gather(&s, paint.sharpness(), true).unwrap();
    let double = |d: [f32; 3]| Vec3::new(d[0].into(), d[1].into(), d[2].into());
    let pictures = gathered.pictures(&|l, v, out| {
        for ((l, v), o) in l.iter().zip(v).zip(out) {
            *o = paint.eval(double(*l), double(*v)).map(|x| x as f32);
        }
    });
    for (view, made) in s.views.iter().zip(&pictures) {
        let image = render(&s, view, Paint { brdf: &paint, gloss: None }, RenderOptions::default()).unwrap();
        for (a, b) in image.values.iter().zip(&made.values) {
            assert!((0..3).all(|c| (a[c] - b[c]).abs() <= 2e-4 * a[c].abs() + 1e-5), "{a:?} {b:?}");
        }
    }
    let geometries = gathered.geometries();
    let total: f64 = geometries.iter().map(|g| g.1).sum();
    assert!((total - 1.0).abs() < 1e-9 && geometries.len() > 500, "{total} {}", geometries.len());
    assert!(geometries.iter().all(|(g, _)| g.theta_i.degrees() <= 90.0 && g.theta_o.degrees() <= 90.0));
}

#[test]
fn an_environment_on_a_ball_is_the_sum_over_its_directions() {
    let paint = AshikhminShirleySimplified { diffuse: [0.3; 3], specular: [0.2; 3], exponent: 40.0 };
    let s = scene(
        "size = [5, 5]\nsamples = 4096\ncamera = { from = [0, 0, 6], height = 0.02 }\nobject = { shape = \"sphere\" }\n[[light]]\nkind = \"environment\"\nsky = \"studio\"\n",
    );
    let image = picture(&s, &paint, RenderOptions::default());
    let middle = f64::from(image.values[12][0]);
    let gonio_render::light::Lamp::Environment(sky) = &s.views[0].lamps[0] else { panic!() };
    let n = 400_000;
    let sum: f64 = (0..n)
        .map(|k| {
            let z = (f64::from(k) + 0.5) / f64::from(n);
            let (a, b) = (f64::from(k) * 2.399_963_229_728_653).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let d = Vec3::new(r * a, r * b, z);
            sky.radiance(d)[0] * paint.eval(d, Vec3::Z)[0] * z
        })
        .sum::<f64>()
        * std::f64::consts::TAU
        / f64::from(n);
    assert!((middle / sum - 1.0).abs() < 0.01, "{middle} {sum}");
}

#[test]
fn a_coat_mirrors_the_lamp_and_its_surroundings() {
    let black = Lambert { diffuse: [0.0; 3] };
    let coat = Coat { index: 1.5 };
    let s = scene(
        "size = [21, 21]\nsamples = 4\ncamera = { from = [0, 0, 6], height = 0.2 }\nobject = { shape = \"sphere\" }\n[[light]]\nkind = \"directional\"\ntowards = [0, 0, 1]\nhalf_angle_deg = 2\nirradiance = [3, 3, 3]\n",
    );
    let image =
        render(&s, &s.views[0], Paint { brdf: &black, gloss: Some(coat) }, RenderOptions::default()).unwrap();
    let middle = f64::from(image.values[10 * 21 + 10][0]);
    let expected = 0.04 * 3.0 / (std::f64::consts::PI * 2f64.to_radians().sin().powi(2));
    assert!((middle / expected - 1.0).abs() < 1e-6, "{middle} {expected}");
    // the normal turns by half the lamp's radius: the disc reaches 1° from the middle, 0.0175 of the ball's radius
    let lit = image.values.iter().filter(|v| v[0] > 0.0).count();
    assert!(
        (lit as f64 / 441.0 - std::f64::consts::PI * 1f64.to_radians().sin().powi(2) / 0.04).abs() < 0.01,
        "{lit}"
    );
    let furnace = scene(
        "size = [9, 9]\nsamples = 4\ncamera = { from = [0, 0, 6], height = 0.2 }\nobject = { shape = \"egg\" }\n[[light]]\nkind = \"environment\"\nsky = \"uniform\"\n",
    );
    let image = render(
        &furnace,
        &furnace.views[0],
        Paint { brdf: &black, gloss: Some(coat) },
        RenderOptions::default(),
    )
    .unwrap();
    assert!((image.values[40][0] - 0.04).abs() < 1e-3, "{:?}", image.values[40]);
}

#[test]
fn the_same_scene_gives_the_same_pixels_on_any_number_of_threads() {
    let s = scene(&format!(
        "size = [20, 20]\nsamples = 3\n{FRONT}object = {{ shape = \"egg\" }}\n[[light]]\nkind = \"environment\"\nsky = \"studio\"\n"
    ));
    let paint = Lambert { diffuse: [0.5; 3] };
    let with = |n: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .unwrap()
            .install(|| picture(&s, &paint, RenderOptions::default()))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn bad_scenes_say_what_would_help() {
    let light = "[[light]]\nkind = \"directional\"\ntowards = [0, 0, 1]\n";
    let away = scene(&format!(
        "size = [8, 8]\nsamples = 1\ncamera = {{ from = [0, 0, 6], to = [0, 0, 9] }}\nobject = {{ shape = \"sphere\" }}\n{light}"
    ));
    let e = gather(&away, 0.0, true).unwrap_err();
    assert!(matches!(e, SceneError::NothingVisible { .. }) && e.to_string().contains("camera.to"), "{e}");
    let behind = scene(&format!(
        "size = [8, 8]\nsamples = 1\n{FRONT}object = {{ shape = \"sphere\" }}\n[[light]]\nkind = \"directional\"\ntowards = [0, 0, -1]\n"
    ));
    let e = gather(&behind, 0.0, true).unwrap_err();
    assert!(matches!(e, SceneError::Dark), "{e}");
    let build = |body: &str| {
        let text = format!("format = \"gonio-scene\"\nversion = 1\n{body}");
        SceneFile::from_toml(&text, "bad.toml")
            .and_then(|f| Scene::build(&f, std::path::Path::new(".")))
            .unwrap_err()
            .to_string()
    };
    assert!(build(&format!("{FRONT}object = {{ shape = \"cube\" }}\n{light}")).contains("cube"));
    assert!(build(&format!("{FRONT}object = {{}}\n{light}")).contains("teapot"));
    assert!(build(&format!("{FRONT}object = {{ mesh = \"absent.obj\" }}\n{light}")).contains("absent.obj"));
    assert!(build(&format!("{FRONT}object = {{ shape = \"egg\" }}\n")).contains("[[light]]"));
    assert!(
        build(&format!("camera = {{ from = [0, 1, 0] }}\nobject = {{ shape = \"egg\" }}\n{light}"))
            .contains("up")
    );
    assert!(
        build(&format!("{FRONT}object = {{ shape = \"egg\", scale = -1 }}\n{light}"))
            .contains("object.scale")
    );
    assert!(build(&format!("sise = 3\n{FRONT}object = {{ shape = \"egg\" }}\n{light}")).contains("sise"));
    assert!(
        build(&format!("{FRONT}object = {{ shape = \"egg\" }}\n[[light]]\nkind = \"environment\"\n"))
            .contains("sky")
    );
}
