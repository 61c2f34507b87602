//! Ways to store f for look-ups: their names, how each is built from a material, and what each knows of its own limits.

mod build;
mod built;
mod names;

pub use build::{BuildError, Options};
pub use built::{Built, Standing};
pub use names::{Representation, UnknownRepresentation};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Finding, Material};
    use gonio_brdf::ModelFile;
    use gonio_brdf::formats::Loaded;
    use gonio_brdf::maps::{self, Region};
    use gonio_brdf::{Flag, Scattered, ScatteredPoint};
    use gonio_optics::Geometry;
    use gonio_optics::{Vec3, isoline::Method};

    const PAINT: &str = r#"{"model":"ggx","diffuse":[0.05,0.1,0.3],"lobes":[{"specular":[0.3,0.2,0.1],"alpha":0.3,"r0":0.5}],"coat":{"index":1.5}}"#;

    fn paint() -> Material {
        Material::new("paint", Loaded::Model(Box::new(ModelFile::from_json(PAINT).unwrap())))
    }

    fn scattered(phi: &[f64]) -> Material {
        let paint = paint();
        let mut points = Vec::new();
        for i in 0..8 {
            for o in 0..8 {
                for &p in phi {
                    let geometry = Geometry::from_degrees(10.0 * f64::from(i), 10.0 * f64::from(o), p);
                    let (l, v) = geometry.directions();
                    let value = paint.brdf().unwrap().eval(l, v);
                    points.push(ScatteredPoint { geometry, value, sigma: None, flag: Flag::Measured });
                }
            }
        }
        Material::new("points", Loaded::Scattered(Scattered { points }))
    }

    #[test]
    fn names_are_read_back_and_wrong_ones_answered() {
        for r in Representation::MAPS {
            assert_eq!(r.to_string().parse::<Representation>().unwrap(), r);
        }
        for wrong in ["flake-map", "flake-map:4", "flake-map:x", "photo"] {
            let e = wrong.parse::<Representation>().unwrap_err().to_string();
            assert!(e.contains(wrong) && e.contains("map-vector-parallel"), "{e}");
        }
        assert!(Representation::all().count() > Representation::MAPS.len());
    }

    #[test]
    fn many_at_a_time_is_the_same_as_one_at_a_time() {
        let m = paint();
        let pairs: Vec<_> = Region::default().directions(37, 5).collect();
        let single = |d: Vec3| d.to_array().map(|x| x as f32);
        let (lights, views): (Vec<_>, Vec<_>) = pairs.iter().map(|&(l, v)| (single(l), single(v))).unzip();
        for r in [
            Representation::Table,
            Representation::Aspecular,
            Representation::ColourMap(Method::Clip),
            Representation::FlakeMap(1),
        ] {
            let built = r.build(&m, &Options::new(1.5)).unwrap();
            let mut out = vec![[0.0; 3]; pairs.len()];
            built.eval_many(&lights, &views, &mut out);
            for (o, (l, v)) in out.iter().zip(&pairs) {
                let one = built.eval(*l, *v);
                assert!(
                    (0..3).all(|c| (f64::from(o[c]) - one[c]).abs() <= 1e-4 * one[c] + 1e-6),
                    "{r}: {o:?} {one:?}"
                );
            }
            assert!(built.bytes() > 0 && built.findings.is_empty());
        }
    }

    #[test]
    fn what_a_map_does_not_know_is_told() {
        let at = |b: &Built, g: (f64, f64, f64)| {
            let (l, v) = Geometry::from_degrees(g.0, g.1, g.2).directions();
            b.standing(l, v)
        };
        let clip = Representation::ColourMap(Method::Clip).build(&paint(), &Options::new(1.5)).unwrap();
        assert_eq!(at(&clip, (20.0, 40.0, 0.0)), Standing::Supported);
        assert_eq!(at(&clip, (75.0, 75.0, 110.0)), Standing::CriticalAngle);
        assert_eq!(at(&clip, (85.0, 10.0, 180.0)), Standing::BeyondLargest);
        let few = scattered(&[0.0]);
        let flake = Representation::FlakeMap(0).build(&few, &Options::new(1.5)).unwrap();
        assert_eq!(at(&flake, (60.0, 30.0, 180.0)), Standing::NothingNear);
        assert_eq!(Standing::NothingNear.flag(), 2);
        assert!(
            flake.findings.iter().any(|f| matches!(f, Finding::AllInPlane { count: 61..=64 })),
            "{:?}",
            flake.findings
        );
    }

    #[test]
    fn a_portable_instruments_eight_angles_give_an_estimate_with_its_uncertainty() {
        let paint = paint();
        let at = |geometry: Geometry| {
            let (l, v) = geometry.directions();
            let value = paint.brdf().unwrap().eval(l, v);
            ScatteredPoint { geometry, value, sigma: None, flag: Flag::Measured }
        };
        let points: Vec<_> = maps::multi_angle::portable_geometries().map(at).to_vec();
        let m = Material::new("portable", Loaded::Scattered(Scattered { points: points.clone() }));
        let map = Representation::FlakeMap(0).build(&m, &Options::new(1.5)).unwrap();
        let [median, p95] = map.relative_sigma().unwrap();
        assert!(median > 0.01 && p95 >= median && p95 < 3.0, "{median} {p95}");
        assert!(map.findings.iter().any(|f| f.name() == "estimated"), "{:?}", map.findings);
        for p in &points {
            let (l, v) = p.geometry.directions();
            assert!((map.eval(l, v)[1] / p.value[1] - 1.0).abs() < 0.25, "{:?}", p.geometry);
        }
        // most of what was not measured lies within twice the uncertainty
        let region = map.flake_map().unwrap().region();
        let pairs: Vec<_> = region.directions(400, 1).collect();
        let held = pairs
            .iter()
            .filter(|(l, v)| {
                let s = map.flake_map().unwrap().sigma(*l, *v).unwrap()[1];
                (map.eval(*l, *v)[1] - paint.brdf().unwrap().eval(*l, *v)[1]).abs() <= 2.0 * s
            })
            .count();
        assert!(held > 300, "{held} of 400");
        assert!(Representation::FlakeMap(1).build(&m, &Options::new(1.5)).is_err());
        let clip = Representation::ColourMap(Method::Clip).build(&m, &Options::new(1.5)).unwrap();
        assert!(clip.findings.iter().any(|f| f.name() == "estimated"));
        let few = Material::new("two", Loaded::Scattered(Scattered { points: points[1..3].to_vec() }));
        let e = Representation::FlakeMap(0).build(&few, &Options::new(1.5)).err().unwrap().to_string();
        assert!(e.contains("2 measured geometries"), "{e}");
    }

    #[test]
    fn a_model_that_cannot_be_fitted_is_no_representation() {
        use gonio_brdf::{Grid, Meaning, Measured};
        use gonio_fitter::ModelChoice;
        use gonio_optics::Angle;
        let grid = Grid {
            theta_i_deg: vec![0.0, 30.0, 60.0],
            theta_o_deg: vec![0.0, 20.0, 40.0, 60.0],
            phi_deg: vec![0.0, 90.0, 180.0],
        };
        let mut table = Measured::sampled(grid, paint().brdf().unwrap());
        table.meaning = Meaning::CellMean { lamp_half_angle: Angle::from_degrees(0.5) };
        let m = Material::new("means", Loaded::Table(Box::new(table)));
        let refused =
            |choice| Representation::Model(choice).build(&m, &Options::new(1.5)).err().map(|e| e.to_string());
        // without the light's azimuth there is nothing to tell the two axes apart by
        assert!(
            refused(ModelChoice::AshikhminShirleyAnisotropic)
                .is_some_and(|e| e.contains("could not be fitted"))
        );
        assert!(
            refused(ModelChoice::Lafortune(1)).is_some_and(|e| e.contains("gonio fit --model lafortune"))
        );
        assert!(refused(ModelChoice::Lambert).is_none());
    }

    #[test]
    fn in_plane_measurements_make_a_colour_map_and_no_harmonics() {
        let in_plane = scattered(&[0.0, 180.0]);
        let clip = Representation::ColourMap(Method::Clip).build(&in_plane, &Options::new(1.5)).unwrap();
        let (l, v) = Geometry::from_degrees(50.0, 20.0, 180.0).directions();
        let (is, want) = (clip.eval(l, v), paint().brdf().unwrap().eval(l, v));
        assert!((is[1] / want[1] - 1.0).abs() < 0.1, "{is:?} {want:?}");
        let e = Representation::FlakeMap(1).build(&in_plane, &Options::new(1.5)).err().unwrap();
        assert!(e.to_string().contains("flake-map:0"), "{e}");
        let e = Representation::Table.build(&in_plane, &Options::new(1.5)).err().unwrap();
        assert!(e.to_string().contains("table"), "{e}");
        let out_of_plane = scattered(&[60.0, 90.0]);
        let none = Material::new(
            "n",
            Loaded::Scattered(Scattered {
                points: out_of_plane
                    .scattered()
                    .unwrap()
                    .points
                    .iter()
                    .copied()
                    .filter(|p| p.geometry.theta_i.degrees() > 1.0 && p.geometry.theta_o.degrees() > 1.0)
                    .collect(),
            }),
        );
        let e = Representation::Aspecular.build(&none, &Options::new(1.5)).err().unwrap();
        assert!(e.to_string().contains("in-plane"), "{e}");
    }
}
