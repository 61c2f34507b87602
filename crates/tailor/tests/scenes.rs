//! Choice and planning on scenes whose answers are known.

use gonio_brdf::formats::Loaded;
use gonio_brdf::models::Lambert;
use gonio_brdf::{Flag, Grid, Measured, ModelFile};
use gonio_instrument::builtin;
use gonio_optics::isoline::Method;
use gonio_render::Scene;
use gonio_render::scene::SceneFile;
use gonio_render::trace::{Gathered, gather};
use gonio_tailor::{
    ChoiceError, ChoiceOptions, LikelyMaterial, Material, Options, PlanError, PlanOptions, Representation,
    Statistic, choose, measured_with, next_pose, plan, reach,
};

const PAINT: &str = r#"{"model":"ggx","diffuse":[0.02,0.05,0.16],"lobes":[{"specular":[0.10,0.20,0.45],"alpha":0.24,"r0":0.5}],"coat":{"index":1.5}}"#;

fn scene(towards: &str) -> Gathered {
    let text = format!(
        "format = \"gonio-scene\"\nversion = 1\nsize = [36, 36]\nsamples = 2\ncamera = {{ from = [0, 0, 6], height = 2.1 }}\nobject = {{ shape = \"sphere\" }}\n[[light]]\nkind = \"directional\"\ntowards = {towards}\n"
    );
    let file = SceneFile::from_toml(&text, "test").unwrap();
    gather(&Scene::build(&file, std::path::Path::new(".")).unwrap(), 60.0, true).unwrap()
}

fn paint() -> Material {
    Material::new("paint", Loaded::Model(Box::new(ModelFile::from_json(PAINT).unwrap())))
}

#[test]
fn the_cheapest_within_the_bound_is_chosen_and_its_pixels_are_what_is_said() {
    let seen = scene("[-0.8, 0.33, 0.5]");
    let options = ChoiceOptions {
        build: Options::new(1.5),
        candidates: vec![
            Representation::Table,
            Representation::Aspecular,
            Representation::ColourMap(Method::Clip),
            Representation::FlakeMap(0),
            Representation::FlakeMap(1),
        ],
        bound: 2.0,
        statistic: Statistic::Mean,
    };
    let choice = choose(&paint(), &seen, &options).unwrap();
    let chosen = choice.chosen.unwrap();
    assert!(choice.candidates[chosen].keeps);
    assert!(choice.candidates[..chosen].iter().all(|c| !c.keeps), "something cheaper keeps it");
    assert!(choice.candidates.windows(2).all(|w| w[0].cost.median_ns <= w[1].cost.median_ns));
    let of =
        |r: Representation| choice.candidates.iter().find(|c| c.built.representation == r).unwrap().pixels;
    assert!(of(Representation::FlakeMap(1)).mean < of(Representation::Aspecular).mean);
    let all = ChoiceOptions { bound: 1e-9, candidates: vec![Representation::Aspecular], ..options.clone() };
    let none = choose(&paint(), &seen, &all).unwrap();
    assert!(none.chosen.is_none() && none.nearest(Statistic::Mean).is_some());
    let points = Material::new("points", Loaded::Scattered(gonio_brdf::Scattered { points: vec![] }));
    assert!(matches!(choose(&points, &seen, &options), Err(ChoiceError::Scattered)));
}

/// Every row that is missing takes the values of the nearest that is there: enough of a filling for a test.
fn nearest_row(m: &mut Measured) {
    let [ni, no, np] = m.grid.shape();
    let there: Vec<usize> = (0..ni).filter(|ti| m.flag[m.grid.index(*ti, 0, 0)] == Flag::Measured).collect();
    for ti in 0..ni {
        let Some(&from) = there.iter().min_by_key(|t| t.abs_diff(ti)) else { return };
        for k in 0..no * np {
            let (to, at) = (m.grid.index(ti, 0, 0) + k, m.grid.index(from, 0, 0) + k);
            if m.flag[to] == Flag::Invalid {
                let last_seen = m.grid.index(from, 30, 0) + k % np;
                let at = if m.flag[at] == Flag::Measured { at } else { last_seen };
                m.values[to] = m.values[at];
                m.flag[to] = Flag::Filled;
            }
        }
    }
}

#[test]
fn one_pose_is_enough_for_a_matte_sample_and_a_lobe_asks_for_more() {
    let seen = scene("[-0.8, 0.33, 0.5]");
    let instrument = builtin::description("reference").unwrap().unwrap();
    let matte = Lambert { diffuse: [0.4, 0.3, 0.2] };
    let shiny = ModelFile::from_json(PAINT).unwrap();
    let options = PlanOptions { fill: &nearest_row, bound: None };
    let one = plan(&seen, &instrument, &[LikelyMaterial { brdf: &matte, index: 1.0 }], options).unwrap();
    assert_eq!(one.plan.tilt_deg.len(), 1, "{:?}", one.expected);
    assert!(one.kept && one.plan.check(&instrument).is_ok());
    let more = plan(&seen, &instrument, &[LikelyMaterial { brdf: &shiny, index: 1.5 }], options).unwrap();
    assert!(more.plan.tilt_deg.len() > 3 && more.expected.delta_e <= more.bound, "{:?}", more.expected);
    assert!(matches!(plan(&seen, &instrument, &[], options), Err(PlanError::NoMaterial)));
}

#[test]
fn what_the_instrument_cannot_reach_is_said() {
    let instrument = builtin::description("reference").unwrap().unwrap();
    let front = reach(&scene("[0, 0.01, 1]"), &instrument);
    assert!(
        (front.measured + front.exchanged + front.beyond - 1.0).abs() < 1e-9 && front.measured > 0.8,
        "{front:?}"
    );
    // lit from behind: only the rim shows
    let rim = scene("[0, 0.12, -1]");
    let matte = Lambert { diffuse: [0.4; 3] };
    let asked = plan(
        &rim,
        &instrument,
        &[LikelyMaterial { brdf: &matte, index: 1.0 }],
        PlanOptions { fill: &nearest_row, bound: None },
    );
    assert!(matches!(asked, Err(PlanError::OutOfReach { .. })), "{asked:?}");
}

#[test]
fn the_next_pose_lies_in_the_gap_that_counts() {
    let seen = scene("[-0.8, 0.33, 0.5]");
    let table = Measured::sampled(Grid::sopp(), &ModelFile::from_json(PAINT).unwrap());
    let with = |tilts: &[f64]| {
        let none = |_: &mut Measured| {};
        measured_with(&table, tilts, &none)
    };
    let all: Vec<f64> = (0..18).map(|k| 5.0 * f64::from(k)).collect();
    let first = next_pose(&seen, &with(&[]), &all, &nearest_row);
    assert!(first.tilt_deg.is_some() && first.expected >= 100.0);
    let left: Vec<f64> = all.iter().copied().filter(|t| ![0.0, 80.0].contains(t)).collect();
    let second = next_pose(&seen, &with(&[0.0, 80.0]), &left, &nearest_row);
    let tilt = second.tilt_deg.unwrap();
    assert!(tilt > 10.0 && tilt < 70.0, "{second:?}");
    let dense = next_pose(&seen, &with(&all[..17]), &all[17..], &nearest_row);
    assert!(dense.expected < second.expected, "{dense:?} {second:?}");
}
