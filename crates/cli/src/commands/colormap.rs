//! `gonio colormap`: Kirchner's colour map, the aspecular-only map or a flake map, as a picture or for shaders.

use std::path::Path;

use gonio_brdf::{Brdf, Rgb};
use gonio_optics::{
    Angle, Geometry, Vec3,
    flake::{FlakeAngles, flake_angles},
    isoline::Method,
};
use gonio_render::plots::{ColourMapPlot, FlakeMapPlot, flake_map};
use gonio_render::{MapImage, Picture};
use gonio_tailor::{Built, Finding, Gloss, Material, Options, Representation, without_gloss};
use serde_json::json;

use crate::arguments::effect::ColormapArguments;
use crate::effect;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer, shown};

/// A map with what a picture or a file of it needs.
pub struct Drawn<'a> {
    /// What is mapped.
    pub material: &'a Material,
    /// How.
    pub options: Options,
    /// The map.
    pub built: Built,
    /// What was done about the gloss; `None` for scattered measurements, which are taken outside the cone only.
    pub gloss: Option<Gloss>,
    /// What to know.
    pub findings: Vec<Finding>,
}

enum Ending {
    Png,
    Exr,
}

/// Draws or writes a map.
///
/// # Errors
/// [`Failure::Usage`] for input that cannot be read or mapped, or an output of another ending.
pub fn run(a: &ColormapArguments, printer: Printer) -> Result<Outcome, Failure> {
    let ending = match a.output.extension().and_then(|e| e.to_str()) {
        Some("png") => Ending::Png,
        Some("exr") => Ending::Exr,
        _ => {
            return Err(Failure::usage(format!(
                "{}: expected a name that ends in .png (a picture) or .exr (values for shaders); a flake map that other commands load is \
                 written by `gonio fit M --model flake-map:K -o map.json`",
                a.output.display()
            )));
        }
    };
    let method: Method = a.method.parse().map_err(Failure::usage)?;
    output::check_free(&a.output, a.force)?;
    output::check_apart(&a.output, &[Path::new(&a.input)])?;
    let material = effect::material(&a.input)?;
    let options = effect::options(&a.map, &material)?;
    let representation = match (a.aspecular, a.flake) {
        (true, _) => Representation::Aspecular,
        (_, Some(k)) => format!("flake-map:{k}").parse().map_err(Failure::usage)?,
        _ => Representation::ColourMap(method),
    };
    let drawn = Drawn::new(&material, representation, options)?;
    effect::say(&drawn.findings);
    let bytes = match ending {
        Ending::Png => drawn.picture(a.factor).to_png(),
        Ending::Exr => drawn.image(method).to_exr(),
    };
    output::write_whole(&a.output, &bytes.map_err(|e| Failure::failed("the map cannot be written", e))?)?;
    let kind = match representation {
        Representation::Aspecular => "aspecular",
        Representation::FlakeMap(_) => "flake-map",
        _ => "colour-map",
    };
    let gloss = drawn
        .gloss
        .map_or_else(|| "measurements near the mirror direction left out".to_owned(), |g| g.to_string());
    printer.result(
        &format!("{kind} of {}, index {}; {gloss}; written to {}", material.name, options.index, a.output.display()),
        &json!({
            "input": a.input, "output": shown(&a.output), "kind": kind, "index": options.index, "method": method.name(),
            "harmonics": drawn.built.flake_map().map(gonio_brdf::maps::FlakeMap::harmonics),
            "largest_deg": a.map.largest_deg, "nodes": options.nodes, "bytes": drawn.built.bytes(), "gloss": drawn.gloss,
            "relative_sigma": drawn.built.relative_sigma(),
            "findings": effect::findings_json(&drawn.findings),
        }),
    );
    Ok(Outcome::Done)
}

impl<'a> Drawn<'a> {
    /// Builds the map.
    ///
    /// # Errors
    /// [`Failure::Usage`] with what the material lacks.
    pub fn new(
        material: &'a Material,
        representation: Representation,
        options: Options,
    ) -> Result<Self, Failure> {
        let mut findings = Finding::of_coat(material, options.index);
        let built = representation.build(material, &options).map_err(Failure::usage)?;
        findings.extend(built.findings.iter().cloned());
        let gloss = match material.brdf() {
            Some(_) => Some(without_gloss(material, options.index, options.gloss).map_err(Failure::usage)?.1),
            None => None,
        };
        Ok(Self { material, options, built, gloss, findings })
    }

    /// The picture, with axes, lines and legend.
    #[must_use]
    pub fn picture(&self, factor: Option<f64>) -> Picture {
        if self.built.flake_map().is_some() {
            self.flake_picture(factor)
        } else {
            self.in_plane_picture(factor)
        }
    }

    fn in_plane_picture(&self, factor: Option<f64>) -> Picture {
        let largest = self.options.largest;
        let limit = largest.degrees() + 1e-9;
        let in_plane = |g: Geometry| -> Option<Rgb> {
            if g.theta_i.degrees() > limit || g.theta_o.degrees() > limit {
                return None;
            }
            let known = self.material.table().is_none()
                || self.material.is_measured_near(g)
                || self.material.is_measured_near(g.swapped());
            known.then(|| self.in_plane(g))
        };
        let flake = Representation::FlakeMap(0).build(self.material, &self.options).ok();
        let beyond =
            |f: FlakeAngles| flake.as_ref().and_then(|b| across(b, f, self.options.index)).map(|c| c.0);
        let aspecular = self.built.representation == Representation::Aspecular;
        let (name, what) = if aspecular {
            ("Aspecular-only map", "colour by the angle from the mirror direction alone, lit at 45°")
        } else {
            ("Colour map", "in-plane geometries")
        };
        let gloss = match self.gloss {
            Some(g) => g.to_string(),
            None => "between the dots a smooth continuation".to_owned(),
        };
        let in_plane_only = |g: &Geometry| {
            let phi = g.phi.degrees();
            (!(0.5..=179.5).contains(&phi) || g.theta_i.degrees() < 0.01 || g.theta_o.degrees() < 0.01)
                && g.from_mirror().degrees() > 10.0
        };
        let measured: Vec<Geometry> = self.measured().filter(in_plane_only).collect();
        ColourMapPlot {
            title: format!("{name} of {}", self.material.name),
            in_plane: &in_plane,
            beyond: if flake.is_some() && !aspecular { Some(&beyond) } else { None },
            index: self.options.index,
            cone: match self.gloss {
                Some(Gloss::Filled { cone_deg }) => Some(Angle::from_degrees(cone_deg)),
                Some(Gloss::Subtracted { lamp_half_angle_deg }) => {
                    Some(Angle::from_degrees(lamp_half_angle_deg))
                }
                _ => None,
            },
            measured: &measured,
            factor,
            note: format!("{what}; index {}; {gloss}", self.options.index),
        }
        .draw()
    }

    /// Geometries of scattered measurements that the map may hold.
    fn measured(&self) -> impl Iterator<Item = Geometry> {
        let limit = self.options.largest.degrees() + 1e-9;
        let points = self.material.scattered().map_or(&[][..], |s| &s.points);
        points
            .iter()
            .map(|p| Geometry { phi: p.geometry.phi.folded(), ..p.geometry })
            .filter(move |g| g.theta_i.degrees() <= limit && g.theta_o.degrees() <= limit)
    }

    fn in_plane(&self, g: Geometry) -> Rgb {
        if let Some(map) = self.built.colour_map() {
            return map.in_plane(g);
        }
        let (l, v) = g.directions();
        self.built.eval(l, v)
    }

    fn flake_picture(&self, factor: Option<f64>) -> Picture {
        let index = self.options.index;
        let k = self.built.flake_map().map_or(0, gonio_brdf::maps::FlakeMap::harmonics);
        let how = if k == 0 { "" } else { ", mean over azimuths" };
        // an estimate says everywhere how uncertain it is, beside dots where it was measured
        let estimated = self.built.relative_sigma().is_some();
        let seen = |g: Geometry| {
            let (l, v) = g.directions();
            flake_angles(l, v, index)
        };
        let measured: Vec<FlakeAngles> =
            if estimated { self.measured().map(seen).collect() } else { Vec::new() };
        FlakeMapPlot {
            title: format!("Flake map of {}", self.material.name),
            colour: &|f| across(&self.built, f, index).map(|(f, covered)| (f, covered || estimated)),
            index,
            largest: self.options.largest,
            measured: &measured,
            factor,
            note: format!(
                "K = {k}{how}; index {index}; without the gloss of the coat{}",
                uncertainty(&self.built)
            ),
        }
        .draw()
    }

    /// The map for shaders.
    #[must_use]
    pub fn image(&self, method: Method) -> MapImage {
        let n = self.options.nodes;
        let mut attributes = vec![
            ("gonio_format".to_owned(), "gonio map 1".to_owned()),
            (
                "gonio_quantity".to_owned(),
                "BRDF f in 1/sr without the cosine, linear Rec. 709 RGB, gloss of the coat left out"
                    .to_owned(),
            ),
            ("gonio_name".to_owned(), self.material.name.clone()),
            ("gonio_index".to_owned(), self.options.index.to_string()),
            (
                "gonio_largest_deg".to_owned(),
                format!("{}", (self.options.largest.degrees() * 1e9).round() / 1e9),
            ),
        ];
        let mut put = |name: &str, text: &str| attributes.push((name.to_owned(), text.to_owned()));
        let (width, height, values) = match self.built.representation {
            Representation::Aspecular => {
                put("gonio_kind", "aspecular");
                put(
                    "gonio_layout",
                    "one row; pixel k: k degrees between the view and the mirror direction; linear between pixel centres, the last one beyond",
                );
                let last = (45.0 + self.options.largest.degrees()) as usize;
                let row = (0..=last).map(|k| {
                    let signed = 45.0 - k as f64;
                    let phi = if signed < 0.0 { 0.0 } else { 180.0 };
                    self.in_plane(Geometry::from_degrees(45.0, signed.abs(), phi))
                });
                (last + 1, 1, row.collect::<Vec<_>>())
            }
            Representation::FlakeMap(_) => {
                put("gonio_kind", "flake-map, harmonic 0");
                put(
                    "gonio_layout",
                    "x = (N-1) n sin(theta_inc), y = (N-1) sqrt(n sin(theta_flake)), from the centre of the upper left pixel; N pixels each way, bilinear; angles inside the coat",
                );
                let values =
                    (0..n * n).map(|i| flake_texel(&self.built, i % n, i / n, n, self.options.index));
                (n, n, values.collect())
            }
            _ => {
                put("gonio_kind", "colour-map");
                put("gonio_method", method.name());
                put(
                    "gonio_layout",
                    "s(t) = sqrt((1 - cos t)/(1 - cos largest)), at most 1; x = (N-1) s(theta_ill); y = (N-1) (1 - s(theta_det)) for phi_det = 180 degrees, (N-1) (1 + s(theta_det)) for phi_det = 0, from the centre of the upper left pixel; N across, 2N-1 down, bilinear; (theta_ill, theta_det, phi_det) by the isoline of index and method",
                );
                let end = 1.0 - self.options.largest.cos();
                let angle = |k: usize| {
                    let s = k as f64 / (n - 1) as f64;
                    Angle::from_radians((1.0 - end * s * s).acos())
                };
                let values = (0..n * (2 * n - 1)).map(|i| {
                    let (x, y) = (i % n, i / n);
                    let phi = if y < n { Angle::STRAIGHT } else { Angle::ZERO };
                    self.in_plane(Geometry { theta_i: angle(x), theta_o: angle(y.abs_diff(n - 1)), phi })
                });
                (n, 2 * n - 1, values.collect())
            }
        };
        MapImage {
            width,
            height,
            values: values.into_iter().map(|f: Rgb| f.map(|x| x as f32)).collect(),
            attributes,
        }
    }
}

/// The uncertainty of an estimated map in words; of others that they have no gloss.
fn uncertainty(built: &Built) -> String {
    built.relative_sigma().map_or_else(String::new, |[median, p95]| {
        format!(
            "; relative uncertainty {:.0} % (median), {:.0} % (95th percentile)",
            100.0 * median,
            100.0 * p95
        )
    })
}

/// f of a flake map at a place, the mean over azimuths that reach it, and whether data stood around.
fn across(built: &Built, f: FlakeAngles, index: f64) -> Option<(Rgb, bool)> {
    let map = built.flake_map()?;
    let steps = if map.harmonics() == 0 { 1 } else { 16 };
    let at = |k: i32| {
        // across the meridian every place that any geometry reaches has a pair of directions
        let azimuth = Angle::from_degrees(90.0 - 90.0 * f64::from(k) / f64::from(steps));
        flake_map::directions(f, azimuth, index)
    };
    let pairs: Vec<(Vec3, Vec3)> = (0..steps).filter_map(at).collect();
    let n = pairs.len() as f64;
    let first = pairs.first()?;
    let mut sum = [0.0; 3];
    for (l, v) in &pairs {
        let said = map.eval(*l, *v);
        for c in 0..3 {
            sum[c] += said[c] / n;
        }
    }
    Some((sum, map.covers(first.0, first.1)))
}

/// A texel of the flake map; places that no geometry reaches take the nearest on the way to the corner of flat flakes.
fn flake_texel(built: &Built, x: usize, y: usize, n: usize, index: f64) -> Rgb {
    let (u, v) = (x as f64 / (n - 1) as f64, y as f64 / (n - 1) as f64);
    let at = |scale: f64| {
        let angle = |s: f64| Angle::from_radians(s.clamp(0.0, 1.0).asin());
        let f =
            FlakeAngles { theta_inc: angle(scale * u / index), theta_flake: angle(scale * v * v / index) };
        across(built, f, index).map(|c| c.0)
    };
    (0..=400).find_map(|k| at(1.0 - f64::from(k) / 400.0)).unwrap_or([0.0; 3])
}
