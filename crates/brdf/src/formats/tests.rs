use std::path::PathBuf;

use proptest::prelude::*;

use super::*;
use crate::maps::{FlakeFitOptions, FlakeMap, Region};
use crate::models::Lambert;
use crate::{Grid, Meaning, Measured};

fn table() -> Measured {
    let grid = Grid { theta_i_deg: vec![0.0, 30.0], theta_o_deg: vec![0.0, 45.0], phi_deg: vec![0.0, 180.0] };
    Measured::sampled(grid, &Lambert { diffuse: [0.3, 0.2, 0.1] })
}

/// A file of every format, made here: name, bytes, what it is.
fn one_of_each() -> Vec<(&'static str, Vec<u8>, Format)> {
    vec![
        ("a.nc", netcdf::write(&table()).unwrap(), Format::Netcdf),
        ("b.csv", measured_csv::write(&table()).into_bytes(), Format::MeasuredCsv),
        ("c.json", br#"{"model": "lambert", "diffuse": [0.3, 0.2, 0.1]}"#.to_vec(), Format::Model),
        ("d.bsdf", rgl::tests::file(), Format::Rgl),
        ("e.mbsdf", mbsdf::tests::file(3), Format::Mbsdf),
        ("f.brdf", b"# c\n2\n500 600\n0.1 0 0.2 3.1 1 2\n".to_vec(), Format::Cornell),
        ("g.f32", nbrdf::tests::file(), Format::NeuralBrdf),
        ("i.json", flake_map().into_bytes(), Format::FlakeMap),
    ]
}

fn flake_map() -> String {
    let samples = Region::default().of_brdf(&Lambert { diffuse: [0.3, 0.2, 0.1] }, 100, 0);
    let options = FlakeFitOptions { nodes: [4, 4], ..FlakeFitOptions::default() };
    FlakeMap::fit("flat", &samples, &options).unwrap().to_json().unwrap()
}

#[test]
fn every_format_is_opened_under_any_name() {
    let dir = tempfile::tempdir().unwrap();
    let mut files = one_of_each();
    files.push(("h.binary", merl::tests::file(), Format::Merl));
    for (k, (_, bytes, format)) in files.into_iter().enumerate() {
        let path = dir.path().join(format!("{k}.xyz"));
        std::fs::write(&path, bytes).unwrap();
        let mut asked = path.clone();
        if format == Format::NeuralBrdf {
            std::fs::write(path.with_extension("names.txt"), "one\ntwo\n").unwrap();
            assert!(open(&path).unwrap_err().to_string().contains("one, two"));
            asked = PathBuf::from(format!("{}#two", path.display()));
        }
        assert_eq!(identify(&path).unwrap(), format);
        let loaded = open(&asked).unwrap();
        let summary = serde_json::to_value(loaded.describe()).unwrap();
        assert!(summary["content"].is_string());
        assert_eq!(loaded.as_brdf().is_none(), format == Format::Cornell);
        if let Some(brdf) = loaded.as_brdf() {
            let (l, v) = gonio_optics::Geometry::from_degrees(20.0, 30.0, 100.0).directions();
            assert!(brdf.eval(l, v).iter().all(|x| x.is_finite() && *x >= 0.0), "{format:?}");
            assert!(
                loaded.to_measured(&Grid::sopp()).unwrap().values.iter().flatten().all(|x| x.is_finite())
            );
        }
    }
    let material = format!("{}#steel", dir.path().join("0.xyz").display());
    assert!(open(material.as_ref()).unwrap_err().to_string().contains("one material"));
    assert!(matches!(open(&dir.path().join("absent")).unwrap_err().problem, Problem::Io(_)));
}

#[test]
fn what_is_saved_is_opened_again_and_what_is_lost_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let nc = dir.path().join("t.nc");
    let csv = dir.path().join("t.csv");
    let mut t = table();
    t.meaning = Meaning::CellMean { lamp_half_angle: gonio_optics::Angle::from_degrees(0.5) };
    t.attributes.insert("sample_id".to_owned(), "7".to_owned());
    let content = Loaded::Table(Box::new(t.clone()));
    assert!(save(&nc, &content, Target::from_path(&nc).unwrap(), false).unwrap().losses.is_empty());
    assert!(matches!(save(&nc, &content, Target::Netcdf, false).unwrap_err().problem, Problem::Exists));
    let Loaded::Table(again) = open(&nc).unwrap() else { panic!("not a table") };
    assert_eq!(*again, t);
    let losses = save(&csv, &content, Target::Csv, true).unwrap().losses;
    assert!(losses.len() == 2 && losses[0].contains("at the nodes"), "{losses:?}");
    assert!(matches!(open(&csv).unwrap(), Loaded::Table(_)));
    assert!(save(&csv, &content, Target::Model, true).unwrap_err().to_string().contains("fit a model"));
    assert!(Target::from_path("x.png".as_ref()).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn damaged_files_of_any_format_give_errors_or_values_and_never_panic(
        kind in 0usize..8,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in prop::option::of(any::<prop::sample::Index>()),
        head in any::<bool>(),
    ) {
        let (_, mut bytes, format) = one_of_each().swap_remove(kind);
        // half of the cases change the header, where the counts are
        let reach = if head { bytes.len().min(120) } else { bytes.len() };
        for (at, value) in changes {
            bytes[at.index(reach)] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x");
        std::fs::write(&path, &bytes).unwrap();
        if format == Format::NeuralBrdf {
            std::fs::write(path.with_extension("names.txt"), "one\ntwo\n").unwrap();
        }
        for asked in [path.clone(), PathBuf::from(format!("{}#two", path.display()))] {
            if let Ok(loaded) = open(&asked) {
                let _ = loaded.describe();
                if let Some(brdf) = loaded.as_brdf() {
                    for (i, o, p) in [(0.0, 0.0, 0.0), (30.0, 60.0, 90.0), (89.0, 89.0, 180.0)] {
                        let (l, v) = gonio_optics::Geometry::from_degrees(i, o, p).directions();
                        let _ = brdf.eval(l, v);
                    }
                }
            }
        }
    }
}
