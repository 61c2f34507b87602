//! The gloss of a coat in a measurement: whether there is any, and f without it.
//!
//! A smooth coat of index n mirrors F(θi) of the light, whatever is beneath: `∫ f_gloss cos θo dω = F(θi)`. A lamp of angular radius α spreads it evenly
//! over its own mirror image, `f_gloss = F(θi)/(π sin²α cos θi)` (the design's coat; Kirchner takes it off by Fresnel's formula before he draws a map). Where the
//! lamp is known that is subtracted; where it is not, the values about the mirror direction are replaced by those at the edge of a cone.

use gonio_brdf::average::{CellBounds, gloss_cell_mean};
use gonio_brdf::{Brdf, Coat, Measured, Rgb};
use gonio_optics::{Angle, Geometry, Vec3, colour, fresnel};
use serde::Serialize;

use crate::Material;
use crate::difference::from_mirror;

/// Less light in the peak than this share of a coat's reflectance counts as none.
const NONE_BELOW: f64 = 0.05;
/// Angle of incidence at which the peak is looked for, degrees.
const LOOKED_AT_DEG: f64 = 45.0;
/// The peak reaches this far, degrees; its ground is taken from there to twice as far.
const PEAK_DEG: f64 = 5.0;

/// What is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum GlossChoice {
    /// What fits: a separated base coat; the lamp's image where the lamp is known; else a cone of 5° where a peak is seen.
    #[default]
    Auto,
    /// Everything stays.
    Keep,
    /// Subtract Fresnel's reflectance over the image of a lamp of this angular radius; `None` takes the one in the file.
    Fresnel(Option<Angle>),
    /// Replace what lies within this angle of the mirror direction.
    Fill(Angle),
}

/// What was done.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "done", rename_all = "kebab-case")]
pub enum Gloss {
    /// There is none in it: a model without its coat's gloss, or a flake map.
    NoneInIt,
    /// No peak was seen, so nothing was taken off.
    NotSeen(GlossPeak),
    /// The file holds the base coat apart, and that was taken.
    Separated,
    /// Subtracted over the lamp's image.
    Subtracted {
        /// Angular radius of the lamp.
        lamp_half_angle_deg: f64,
    },
    /// Replaced within a cone about the mirror direction.
    Filled {
        /// Half angle of the cone.
        cone_deg: f64,
    },
    /// Left in, as asked.
    Kept,
}

/// The peak about the mirror direction at θi = 45°.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GlossPeak {
    /// Light in it (luminance) against F(45°) of the coat; 1 for a smooth coat that was measured whole. `None`: nothing was measured there, or no
    /// coat is assumed.
    pub share: Option<f64>,
}

/// A choice that cannot be followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GlossError {
    /// Scattered measurements.
    #[error(
        "gloss cannot be taken off scattered measurements one by one: leave out those near the mirror direction instead"
    )]
    Scattered,
    /// The lamp is not known.
    #[error(
        "the file does not say how large the lamp was, so its gloss cannot be computed: give its angular radius, or fill the cone about the mirror direction"
    )]
    NoLamp,
    /// No coat, no gloss.
    #[error("a coat of index 1 has no gloss to take off: give the coat's index, or keep the gloss")]
    NoCoat,
}

impl GlossPeak {
    /// Looks for the peak of a coat of `index`.
    #[must_use]
    pub fn of(material: &Material, index: f64) -> Self {
        let none = Self { share: None };
        let Some(brdf) = material.brdf() else { return none };
        let mirror = Geometry::from_degrees(LOOKED_AT_DEG, LOOKED_AT_DEG, 180.0);
        if index <= 1.0 || material.is_model() || !material.is_measured_near(mirror) {
            return none;
        }
        let (light, direction) = mirror.directions();
        let (across, along) = direction.orthonormal_basis();
        let ring = |radius_deg: f64| {
            let r = Angle::from_degrees(radius_deg);
            let sum: f64 = (0..16)
                .map(|k| {
                    let (s, c) = Angle::from_degrees(22.5 * f64::from(k)).sin_cos();
                    let view = (direction * r.cos() + (across * c + along * s) * r.sin()).normalized();
                    colour::luminance(brdf.eval(light, view)).max(0.0)
                })
                .sum();
            sum / 16.0
        };
        let steps = 20;
        let ground = (1..=4).map(|k| ring(PEAK_DEG * (1.0 + 0.25 * f64::from(k)))).sum::<f64>() / 4.0;
        let width = PEAK_DEG / f64::from(steps);
        let peak: f64 = (0..steps)
            .map(|k| {
                let r = width * (f64::from(k) + 0.5);
                (ring(r) - ground).max(0.0)
                    * std::f64::consts::TAU
                    * Angle::from_degrees(r).sin()
                    * width.to_radians()
            })
            .sum();
        let cos = Angle::from_degrees(LOOKED_AT_DEG).cos();
        Self { share: Some(peak * cos / fresnel::dielectric(cos, index)) }
    }

    /// Whether there is gloss to speak of.
    #[must_use]
    pub fn is_seen(self) -> bool {
        self.share.is_some_and(|s| s >= NONE_BELOW)
    }
}

impl std::fmt::Display for Gloss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoneInIt => f.write_str("no gloss in it"),
            Self::NotSeen(GlossPeak { share: Some(s) }) => {
                write!(
                    f,
                    "no gloss of a coat seen (the peak holds {:.1} % of a coat's reflectance): nothing taken off",
                    100.0 * s
                )
            }
            Self::NotSeen(_) => f.write_str("nothing measured at the mirror direction: no gloss taken off"),
            Self::Separated => f.write_str("gloss separated in the measurement"),
            Self::Subtracted { lamp_half_angle_deg } => {
                write!(f, "gloss of a lamp of {lamp_half_angle_deg:.2}° subtracted by Fresnel")
            }
            Self::Filled { cone_deg } => {
                write!(f, "gloss within {cone_deg:.1}° of the mirror direction filled from the edge")
            }
            Self::Kept => f.write_str("gloss kept"),
        }
    }
}

/// f without gloss, and what was done for it.
///
/// # Errors
/// [`GlossError`] where the choice cannot be followed.
pub fn without_gloss(
    material: &Material,
    index: f64,
    choice: GlossChoice,
) -> Result<(Box<dyn Brdf + '_>, Gloss), GlossError> {
    let brdf = material.brdf().ok_or(GlossError::Scattered)?;
    let plain = |gloss| Ok((Box::new(Borrowed(brdf)) as Box<dyn Brdf>, gloss));
    if choice == GlossChoice::Keep {
        return plain(Gloss::Kept);
    }
    if material.is_model() || material.flake_map().is_some() {
        return plain(Gloss::NoneInIt);
    }
    let fill = |cone: Angle| {
        Ok((Box::new(Filled { brdf, cone }) as Box<dyn Brdf>, Gloss::Filled { cone_deg: cone.degrees() }))
    };
    let lamp = match choice {
        GlossChoice::Fresnel(given) => given.or(material.lamp_half_angle()),
        _ => material.lamp_half_angle(),
    };
    match (choice, lamp) {
        (GlossChoice::Fill(cone), _) => fill(cone),
        (GlossChoice::Fresnel(_), None) => Err(GlossError::NoLamp),
        (GlossChoice::Fresnel(_), _) if index <= 1.0 => Err(GlossError::NoCoat),
        (GlossChoice::Fresnel(_), Some(lamp)) => Ok(subtracted(material, brdf, index, lamp)),
        _ => {
            // the base was separated with the coat that the file states, whatever index maps are asked for
            let own = material.stated_index().unwrap_or(index);
            if let Some(separated) = material.table().and_then(|t| base_through_coat(t, own)) {
                return Ok((Box::new(separated), Gloss::Separated));
            }
            let peak = GlossPeak::of(material, index);
            match (peak.is_seen(), lamp) {
                (false, _) => plain(Gloss::NotSeen(peak)),
                (true, Some(lamp)) => Ok(subtracted(material, brdf, index, lamp)),
                (true, None) => fill(Angle::from_degrees(PEAK_DEG)),
            }
        }
    }
}

/// The base coat that a table keeps apart, seen through the coat: T(θi) T(θo)/n² · f_base.
fn base_through_coat(t: &Measured, index: f64) -> Option<Measured> {
    let base = t.base.as_ref()?;
    let through = |cos: f64| 1.0 - fresnel::dielectric(cos, index);
    let mut out = t.clone();
    for (i, (value, base)) in out.values.iter_mut().zip(base).enumerate() {
        let [ti, to, phi] = t.grid.coordinates(i);
        let g = t.grid.geometry(ti, to, phi);
        let k = (through(g.theta_i.cos()) * through(g.theta_o.cos()) / (index * index)) as f32;
        *value = base.map(|f| k * f);
    }
    Some(out)
}

fn subtracted<'a>(
    material: &Material,
    brdf: &'a dyn Brdf,
    index: f64,
    lamp: Angle,
) -> (Box<dyn Brdf + 'a>, Gloss) {
    let done = Gloss::Subtracted { lamp_half_angle_deg: lamp.degrees() };
    let coat = Coat { index };
    let Some(table) = material.table() else { return (Box::new(Subtracted { brdf, coat, lamp }), done) };
    let mut out = table.clone();
    for (i, value) in out.values.iter_mut().enumerate() {
        let cell = table.grid.coordinates(i);
        let g = table.grid.geometry(cell[0], cell[1], cell[2]);
        let gloss = if material.lamp_half_angle().is_some() {
            gloss_cell_mean(coat.gloss_level(g.theta_i.cos(), lamp), &CellBounds::of(&table.grid, lamp, cell))
        } else {
            let (l, v) = g.directions();
            coat.gloss(l, v, lamp)
        };
        *value = value.map(|f| (f - gloss as f32).max(0.0));
    }
    (Box::new(out), done)
}

struct Borrowed<'a>(&'a dyn Brdf);

impl Brdf for Borrowed<'_> {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        self.0.eval(light, view)
    }
}

struct Subtracted<'a> {
    brdf: &'a dyn Brdf,
    coat: Coat,
    lamp: Angle,
}

impl Brdf for Subtracted<'_> {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let gloss = self.coat.gloss(light, view, self.lamp);
        self.brdf.eval(light, view).map(|f| (f - gloss).max(0.0))
    }
}

struct Filled<'a> {
    brdf: &'a dyn Brdf,
    cone: Angle,
}

impl Brdf for Filled<'_> {
    /// Within the cone: f at its edge, on the side on which the view lies (towards the normal from its very middle).
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        let mirror = Vec3::new(-light.x, -light.y, light.z);
        if from_mirror(light, view) >= self.cone {
            return self.brdf.eval(light, view);
        }
        let edge = |towards: Vec3| {
            let side = towards - mirror * towards.dot(mirror);
            let length = side.norm();
            (length > 1e-9)
                .then(|| (mirror * self.cone.cos() + side * (self.cone.sin() / length)).normalized())
        };
        // straight above the middle any side serves
        let outwards = edge(view).or_else(|| edge(Vec3::Z)).or_else(|| edge(Vec3::new(1.0, 0.0, 0.0)));
        match outwards {
            Some(v) if v.z > 0.0 => self.brdf.eval(light, v),
            _ => self.brdf.eval(light, edge(Vec3::Z).unwrap_or(view)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::formats::Loaded;
    use gonio_brdf::models::Lambert;
    use gonio_brdf::{Grid, Meaning, Model, ModelFile};

    /// A matte base under a coat, measured with a lamp of 2°.
    fn coated() -> (ModelFile, Measured, Angle) {
        let lamp = Angle::from_degrees(2.0);
        let mut file =
            ModelFile::from_json(r#"{"model":"lambert","diffuse":[0.3,0.2,0.1],"coat":{"index":1.5}}"#)
                .unwrap();
        file.fit = None;
        let mut t = Measured::empty(Grid::sopp(), Meaning::CellMean { lamp_half_angle: lamp });
        for i in 0..t.grid.len() {
            let cell = t.grid.coordinates(i);
            t.values[i] =
                gonio_brdf::average::model_cell_mean(&file, &t.grid, t.meaning, cell).map(|f| f as f32);
            t.flag[i] = gonio_brdf::Flag::Measured;
        }
        (file, t, lamp)
    }

    #[test]
    fn a_measured_coat_is_seen_and_subtracted() {
        let (file, t, lamp) = coated();
        let m = Material::new("coated", Loaded::Table(Box::new(t)));
        // bins of 2.5° by 5° and linear interpolation between them spread the peak; most of it is there
        let share = GlossPeak::of(&m, 1.5).share.unwrap();
        assert!((0.4..1.2).contains(&share), "{share}");
        let (body, done) = without_gloss(&m, 1.5, GlossChoice::Auto).unwrap();
        assert_eq!(done, Gloss::Subtracted { lamp_half_angle_deg: lamp.degrees() });
        for (ti, to) in [(45.0, 45.0), (30.0, 30.0), (60.0, 55.0), (20.0, 20.0)] {
            let (l, v) = Geometry::from_degrees(ti, to, 180.0).directions();
            let (is, want) = (body.eval(l, v)[0], file.eval(l, v)[0]);
            assert!((is / want - 1.0).abs() < 0.05, "{ti} {to}: {is} {want}");
        }
    }

    #[test]
    fn a_base_that_was_measured_apart_is_seen_through_its_own_coat() {
        let (file, mut t, _) = coated();
        t.attributes.insert("coat_index".to_owned(), "1.5".to_owned());
        t.base = Some(vec![[0.3, 0.2, 0.1].map(|d: f32| d / std::f32::consts::PI); t.grid.len()]);
        let m = Material::new("separated", Loaded::Table(Box::new(t)));
        let (body, done) = without_gloss(&m, 1.3, GlossChoice::Auto).unwrap();
        assert_eq!(done, Gloss::Separated);
        for (ti, to) in [(45.0, 45.0), (30.0, 60.0), (60.0, 20.0)] {
            let (l, v) = Geometry::from_degrees(ti, to, 180.0).directions();
            assert!((body.eval(l, v)[0] / file.eval(l, v)[0] - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn a_matte_sample_has_no_gloss_and_it_is_said() {
        let t = Measured::sampled(Grid::sopp(), &Lambert { diffuse: [0.4; 3] });
        let m = Material::new("matte", Loaded::Table(Box::new(t)));
        let (_, done) = without_gloss(&m, 1.5, GlossChoice::Auto).unwrap();
        assert!(matches!(done, Gloss::NotSeen(GlossPeak { share: Some(s) }) if s < 1e-6), "{done:?}");
        assert!(done.to_string().contains("no gloss"));
        assert!(matches!(without_gloss(&m, 1.5, GlossChoice::Fresnel(None)), Err(GlossError::NoLamp)));
        let one = without_gloss(&m, 1.0, GlossChoice::Fresnel(Some(Angle::from_degrees(1.0))));
        assert!(matches!(one, Err(GlossError::NoCoat)));
    }

    #[test]
    fn a_filled_cone_is_continuous_and_leaves_the_rest_alone() {
        let sharp = ModelFile {
            model: Model::BlinnPhong(gonio_brdf::models::BlinnPhong {
                diffuse: [0.1; 3],
                specular: [0.2; 3],
                exponent: 3000.0,
            }),
            coat: None,
            fit: None,
        };
        let f = Filled { brdf: &sharp, cone: Angle::from_degrees(5.0) };
        let at = |to: f64, phi: f64| {
            let (l, v) = Geometry::from_degrees(45.0, to, phi).directions();
            (f.eval(l, v)[0], sharp.eval(l, v)[0])
        };
        assert_eq!(at(30.0, 180.0).0, at(30.0, 180.0).1);
        assert!((at(40.001, 180.0).0 / at(39.999, 180.0).0 - 1.0).abs() < 0.01);
        assert!(at(45.0, 180.0).0 < 0.2 * at(45.0, 180.0).1);
        assert!(at(45.0, 180.0).0.is_finite());
        let (l, v) = (Vec3::Z, Vec3::Z);
        assert!(f.eval(l, v)[0] < 0.2 * sharp.eval(l, v)[0]);
    }
}
