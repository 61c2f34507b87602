//! A representation at work: what it answers, how that stands to what was measured, and what it costs.

use gonio_brdf::maps::{self, Aspecular, ColourMap, FlakeMap, LookupTable};
use gonio_brdf::{Brdf, ModelFile, Rgb};
use gonio_optics::{Angle, Vec3, colour};

use super::Representation;
use crate::Finding;
use crate::timing::Direction;

/// How an answer stands to what was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// Data stood around it.
    Supported,
    /// The critical angle was met, so the method's rule decided.
    CriticalAngle,
    /// Steeper than the map reaches: the value at its edge, or a continuation.
    BeyondLargest,
    /// Nothing was measured near: a smooth continuation.
    NothingNear,
    /// Within the cone about the mirror direction that a flake map leaves out: its answer has no gloss.
    Gloss,
}

impl From<maps::Standing> for Standing {
    fn from(s: maps::Standing) -> Self {
        match s {
            maps::Standing::Measured => Self::Supported,
            maps::Standing::Continued => Self::NothingNear,
            maps::Standing::Gloss => Self::Gloss,
            maps::Standing::BeyondLargest | maps::Standing::BelowHorizon => Self::BeyondLargest,
        }
    }
}

impl Standing {
    /// As the column `flag` of measured files says it: 0 measured, 2 extrapolated.
    #[must_use]
    pub const fn flag(self) -> u8 {
        if matches!(self, Self::Supported) { 0 } else { 2 }
    }
}

/// A representation built from a material.
pub struct Built {
    /// Which.
    pub representation: Representation,
    /// What to know about it.
    pub findings: Vec<Finding>,
    pub(super) evaluator: Evaluator,
    pub(super) largest: Angle,
}

pub(super) enum Evaluator {
    Table(LookupTable),
    Colour(ColourMap),
    Flake(FlakeMap),
    Aspecular(Aspecular),
    Model(Box<ModelFile>, usize),
}

impl Built {
    /// f in 1/sr of unit directions.
    #[must_use]
    pub fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        self.brdf().eval(light, view)
    }

    /// The representation as a function.
    #[must_use]
    pub fn brdf(&self) -> &dyn Brdf {
        match &self.evaluator {
            Evaluator::Table(t) => t,
            Evaluator::Colour(m) => m,
            Evaluator::Flake(m) => m,
            Evaluator::Aspecular(a) => a,
            Evaluator::Model(m, _) => m.as_ref(),
        }
    }

    /// The flake map, if it is one.
    #[must_use]
    pub fn flake_map(&self) -> Option<&FlakeMap> {
        if let Evaluator::Flake(m) = &self.evaluator { Some(m) } else { None }
    }

    /// Relative standard uncertainty of the luminance over the region of the maps by solid angle, median and 95th percentile; `None` where the
    /// representation states none.
    #[must_use]
    pub fn relative_sigma(&self) -> Option<[f64; 2]> {
        let map = self.flake_map().filter(|m| m.has_sigma())?;
        let at = |(l, v): (Vec3, Vec3)| {
            let y = colour::luminance(map.eval(l, v));
            map.sigma(l, v).map(|s| colour::luminance(s) / y).filter(|r| r.is_finite())
        };
        let mut all: Vec<f64> = map.region().directions(1000, 2).filter_map(at).collect();
        all.sort_by(f64::total_cmp);
        let pick = |q: usize| all.get(all.len() * q / 100).copied();
        Some([pick(50)?, pick(95)?])
    }

    /// The colour map, if it is one.
    #[must_use]
    pub fn colour_map(&self) -> Option<&ColourMap> {
        if let Evaluator::Colour(m) = &self.evaluator { Some(m) } else { None }
    }

    /// How the answer for a geometry stands to what was measured.
    #[must_use]
    pub fn standing(&self, light: Vec3, view: Vec3) -> Standing {
        let low = self.largest.cos() - 1e-9;
        let steep = light.z < low || view.z < low;
        match &self.evaluator {
            Evaluator::Colour(m) => {
                if m.equivalent(light, view).limited {
                    return Standing::CriticalAngle;
                }
            }
            Evaluator::Flake(m) => return m.standing(light, view).into(),
            Evaluator::Table(_) | Evaluator::Aspecular(_) | Evaluator::Model(..) => {}
        }
        if steep && !matches!(self.evaluator, Evaluator::Table(_)) {
            Standing::BeyondLargest
        } else {
            Standing::Supported
        }
    }

    /// Bytes that a look-up reads from: three channels of 32 bits; of a model its parameters.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match &self.evaluator {
            Evaluator::Table(t) => t.bytes(),
            Evaluator::Colour(m) => m.bytes(),
            Evaluator::Flake(m) => m.bytes(),
            Evaluator::Aspecular(a) => a.bytes(),
            Evaluator::Model(_, bytes) => *bytes,
        }
    }

    /// The arithmetic of [`Self::eval_many`].
    #[must_use]
    pub const fn arithmetic(&self) -> &'static str {
        match &self.evaluator {
            Evaluator::Table(_) => "f32, one at a time",
            Evaluator::Flake(_) => "f32, many at a time",
            Evaluator::Colour(_) | Evaluator::Aspecular(_) | Evaluator::Model(..) => "f64, one at a time",
        }
    }

    /// f of many geometries by the fastest path there is; ends with the shortest slice.
    pub fn eval_many(&self, lights: &[Direction], views: &[Direction], out: &mut [[f32; 3]]) {
        let each = |out: &mut [[f32; 3]], f: &dyn Brdf| {
            for ((l, v), o) in lights.iter().zip(views).zip(out) {
                *o = f.eval(double(*l), double(*v)).map(|x| x as f32);
            }
        };
        match &self.evaluator {
            Evaluator::Table(t) => {
                for ((l, v), o) in lights.iter().zip(views).zip(out) {
                    *o = t.eval_single(*l, *v);
                }
            }
            Evaluator::Flake(m) => m.eval_many(lights, views, out),
            Evaluator::Colour(m) => each(out, m),
            Evaluator::Aspecular(a) => each(out, a),
            Evaluator::Model(m, _) => each(out, m.as_ref()),
        }
    }
}

fn double(d: Direction) -> Vec3 {
    let [x, y, z] = d.map(f64::from);
    Vec3::new(x, y, z)
}
