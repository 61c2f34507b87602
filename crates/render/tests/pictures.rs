//! Pictures as a whole: known colours at known places, awkward tables, repeatability.

use gonio_brdf::models::{AshikhminShirleySimplified, Lambert};
use gonio_brdf::{Brdf, Flag, Grid, Meaning, Measured};
use gonio_optics::Angle;
use gonio_render::Picture;
use gonio_render::plots::{self, Channel, Compare, Curve, Difference, Lobe, Unfolded};
use gonio_render::report::{Block, Figure, Fit, Report, Section, standard_figures};
use proptest::prelude::*;

const PAINT: AshikhminShirleySimplified =
    AshikhminShirleySimplified { diffuse: [0.3, 0.1, 0.05], specular: [0.1; 3], exponent: 40.0 };

fn all(m: &Measured, model: &dyn Brdf) -> Vec<Picture> {
    let lobe = |channel| {
        plots::lobe(m, &[Curve { label: "fit", brdf: model }], &Lobe { channel, ..Lobe::default() })
    };
    let compare = |difference| plots::compare(m, model, &Compare { difference, ..Compare::default() });
    vec![
        plots::unfolded(m, &Unfolded::default()),
        compare(Difference::Relative),
        compare(Difference::DeltaE),
        lobe(Channel::Luminance),
        lobe(Channel::Blue),
        plots::coverage(m, "coverage"),
        plots::sigma(m, "σ"),
    ]
}

fn small_grid() -> Grid {
    Grid {
        theta_i_deg: vec![0.0, 30.0, 60.0],
        theta_o_deg: vec![0.0, 30.0, 60.0, 90.0],
        phi_deg: vec![0.0, 60.0, 120.0, 180.0],
    }
}

fn contains(p: &Picture, colour: [u8; 3]) -> usize {
    p.pixels().iter().filter(|c| **c == colour).count()
}

#[test]
fn an_unfolded_diffuser_shows_its_own_colour_and_hatches_its_holes() {
    // sRGB of 0.5, 0.18 and 0 is 188, 118, 0
    let mut m = Measured::sampled(small_grid(), &Lambert { diffuse: [0.5, 0.18, 0.0] });
    let options = Unfolded { factors: vec![1.0], ..Unfolded::default() };
    let whole = contains(&plots::unfolded(&m, &options), [188, 118, 0]);
    // a third of the blocks goes, and with it a third of the coloured area
    for o in 0..4 {
        for p in 0..4 {
            let i = m.grid.index(1, o, p);
            m.flag[i] = Flag::Invalid;
        }
    }
    let rest = contains(&plots::unfolded(&m, &options), [188, 118, 0]);
    assert!(whole > 100_000, "{whole}");
    assert!((rest as f64 / whole as f64 - 2.0 / 3.0).abs() < 0.01, "{rest} of {whole}");
}

#[test]
fn one_cell_takes_the_place_that_its_angles_have() {
    let mut m = Measured::sampled(small_grid(), &Lambert { diffuse: [0.5; 3] });
    let i = m.grid.index(2, 1, 1);
    let third = 1.0 / std::f32::consts::PI;
    m.values[i] = [third, 0.0, 0.0];
    let p = plots::unfolded(&m, &Unfolded { factors: vec![1.0], ..Unfolded::default() });
    let red: Vec<(u32, u32)> = (0..p.height())
        .flat_map(|y| (0..p.width()).map(move |x| (x, y)))
        .filter(|&(x, y)| p.get(x, y) == Some([255, 0, 0]))
        .collect();
    let (left, right) = (red.iter().map(|c| c.0).min().unwrap(), red.iter().map(|c| c.0).max().unwrap());
    // φ 30…90 and its mirror image 270…330 of 0…360: the two together span 30/360…330/360 of the strip, half of it empty
    let strip = 520.0;
    assert!((f64::from(right - left + 1) - strip * 300.0 / 360.0).abs() <= 2.0, "{left} {right}");
    let wide = red.iter().filter(|c| c.1 == red[0].1).count() as f64;
    assert!((wide - strip * 120.0 / 360.0).abs() <= 4.0, "{wide}");
    // θo 15…45 of 90: a third of a block of 120 points
    let tall = red.iter().filter(|c| c.0 == left + 1).count() as f64;
    assert!((tall - 240.0 / 3.0).abs() <= 2.0, "{tall}");
}

#[test]
fn a_perfect_fit_has_the_colour_of_zero_everywhere() {
    let m = Measured::sampled(small_grid(), &PAINT);
    let p = plots::compare(&m, &PAINT, &Compare::default());
    let zero = gonio_render::draw::palette::ColourMap::Vik.at(0.5);
    // the middle strip: 400 by 732 pixels at two a point, three blocks of 120 points
    let middle = contains(&p, zero) as f64;
    assert!(middle > 0.97 * 400.0 * 720.0, "{middle}");
}

#[test]
fn awkward_tables_give_pictures_too() {
    let sopp = Measured::sampled(Grid::sopp(), &PAINT);
    let mut nan = sopp.clone();
    nan.values.fill([f32::NAN; 3]);
    nan.sigma.fill([f32::INFINITY; 3]);
    let mut negative = sopp.clone();
    negative.values.iter_mut().step_by(3).for_each(|v| *v = [-0.1, 0.0, 1e30]);
    negative.sigma.fill([f32::MAX; 3]);
    let black = Measured::sampled(Grid::sopp(), &Lambert { diffuse: [0.0; 3] });
    let empty =
        Measured::empty(Grid { theta_i_deg: vec![], theta_o_deg: vec![], phi_deg: vec![] }, Meaning::Node);
    let single = Measured::sampled(
        Grid { theta_i_deg: vec![45.0], theta_o_deg: vec![45.0], phi_deg: vec![180.0] },
        &PAINT,
    );
    let mut short = sopp.clone();
    short.values.truncate(10);
    short.sigma.clear();
    short.flag.truncate(20);
    for (name, table) in [
        ("nan", nan),
        ("negative", negative),
        ("black", black),
        ("empty", empty),
        ("single", single),
        ("short", short),
    ] {
        for (k, p) in all(&table, &PAINT).iter().enumerate() {
            assert!(p.width() > 300 && p.height() > 100, "{name} {k}");
        }
    }
}

#[test]
fn the_same_table_gives_the_same_pixels() {
    let meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
    let mut m = plots::model_table(&Measured::empty(small_grid(), meaning), &PAINT, 4, 2);
    m.sigma.iter_mut().zip(&m.values).for_each(|(s, v)| *s = v.map(|x| x * 0.03));
    assert_eq!(all(&m, &PAINT), all(&m, &PAINT));
}

#[test]
fn a_report_keeps_its_pictures_as_files_and_refuses_names_that_leave_the_folder() {
    let m = Measured::sampled(small_grid(), &PAINT);
    let figures = standard_figures(&m, Some(Fit { name: "fit", brdf: &PAINT, coat: None }));
    let names: Vec<String> = figures.iter().map(|f| f.name.clone()).collect();
    assert_eq!(names, ["lobe", "spheres", "compare", "unfolded", "coverage", "sigma"]);
    let section =
        |figures: Vec<Figure>| Section { blocks: vec![Block::Pictures(figures)], ..Section::default() };
    let mut report = Report { title: "T".into(), sections: vec![section(figures)], ..Report::default() };
    let dir = tempfile::tempdir().unwrap();
    let written = report.save_pictures(dir.path()).unwrap();
    assert_eq!(written.len(), 6);
    assert_eq!(image::open(&written[0]).unwrap().to_rgb8().width(), 1520);
    let html = report.to_html().unwrap();
    assert_eq!(html.matches("data:image/png;base64,").count(), 6);
    for name in ["../evil", "", "a b", "lobe"] {
        let picture = Picture::new(1, 1, [0; 3]);
        let bad = Figure { name: name.into(), picture, caption: String::new(), alt: String::new() };
        report.sections.push(section(vec![bad]));
        assert!(report.save_pictures(dir.path()).is_err(), "{name:?}");
        report.sections.pop();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn any_values_any_flags_can_be_drawn(
        values in proptest::collection::vec((any::<f32>(), any::<f32>(), 0u8..4), 48),
    ) {
        let mut m = Measured::empty(small_grid(), Meaning::Node);
        for (i, (v, s, flag)) in values.into_iter().enumerate() {
            m.values[i] = [v, v * 0.5, s];
            m.sigma[i] = [s; 3];
            m.flag[i] = Flag::from_byte(flag).unwrap();
        }
        prop_assert_eq!(all(&m, &Lambert { diffuse: [0.2; 3] }).len(), 7);
    }
}
