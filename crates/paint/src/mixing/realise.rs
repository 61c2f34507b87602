//! One mixture: corners, χ and coefficients for given weights.

use std::sync::Arc;

use super::{MixError, Mixable};
use crate::car_paint::{CarPaint, CarPaintParts, FlakeDraws, Flakes};
use crate::statistics::{Cluster, FlakeStatistics};

/// What the weights work on; the rest stays that of the first paint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Part {
    /// All of the paint.
    #[default]
    Everything,
    /// Lightness of the flakes alone: how much it sparkles (Golla & Klein, Fig. 3).
    Lightness,
    /// All but the lightness of the flakes (Fig. 4).
    Hue,
    /// All, and the flakes without hue: grey sparkle (Fig. 5).
    GreySparkle,
    /// The base alone: coefficients and χ; the flakes stay.
    Base,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Everything, Self::Lightness, Self::Hue, Self::GreySparkle, Self::Base];

    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Everything => "everything",
            Self::Lightness => "lightness",
            Self::Hue => "hue",
            Self::GreySparkle => "grey-sparkle",
            Self::Base => "base",
        }
    }
}

/// Numbers of a mixture, in memory that is used again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Realisation {
    /// Six planes as long as there are paths: L*, a*, b* of one corner, then of the other.
    pub corners: Vec<f32>,
    /// Factors of χ.
    pub chi: Vec<[f32; 3]>,
    /// Index of the coat, diffuse, lobes, side of a texel.
    pub coefficients: Vec<f64>,
}

/// A mixture as a paint, and what is to be said about it.
#[derive(Clone, Debug)]
pub struct Mixed {
    /// The paint.
    pub paint: Arc<CarPaint>,
    /// A sentence each.
    pub notes: Vec<String>,
}

impl Mixable {
    /// Writes the mixture of these weights, one for each paint (missing ones are 0). Nothing is allocated from the second time on.
    pub fn realise(&self, weights: &[f64], part: Part, out: &mut Realisation) {
        let n = self.paints.len();
        let mut own = [0.0; 16];
        let mut given = [0.0; 16];
        // a mixture of more than sixteen is refused by `mix`; here the rest counts nothing
        own[0] = 1.0;
        for (g, w) in given.iter_mut().zip(weights) {
            *g = *w;
        }
        let none = [0.0; 16];
        let (lightness, hue, base) = match part {
            Part::Everything => (&given, &given, &given),
            Part::Lightness => (&given, &own, &own),
            Part::Hue => (&own, &given, &given),
            Part::GreySparkle => (&given, &none, &given),
            Part::Base => (&own, &own, &given),
        };
        let paths = self.steps.len();
        out.corners.resize(6 * paths, 0.0);
        if paths > 0 {
            for (plane, slot) in out.corners.chunks_exact_mut(paths).enumerate() {
                let weights = if plane % 3 == 0 { lightness } else { hue };
                let range = plane * paths..(plane + 1) * paths;
                blend(slot, self.corners.iter().take(16).map(|c| &c[range.clone()]), weights);
            }
        }
        out.chi.resize(self.analytic.nodes(), [0.0; 3]);
        out.coefficients.resize(self.analytic.coefficients[0].len(), 0.0);
        self.analytic.blend(&base[..n.min(16)], &mut out.coefficients, &mut out.chi);
    }

    /// The mixture as a paint. At weight 1 of one paint and 0 of all others it is that paint itself.
    ///
    /// # Errors
    /// [`MixError`] for another number of weights than paints, weights that are no numbers.
    pub fn mix(&self, weights: &[f64], part: Part) -> Result<Mixed, MixError> {
        let notes = self.check(weights)?;
        let others = weights.iter().filter(|w| **w != 0.0).count();
        let whole = weights.iter().position(|w| *w == 1.0).filter(|_| others == 1);
        // all parts of the first paint are the first paint, but for sparkle made grey
        let whole = match part {
            Part::Everything => whole,
            Part::GreySparkle => None,
            Part::Lightness | Part::Hue | Part::Base => whole.filter(|k| *k == 0),
        };
        match whole {
            Some(k) => Ok(Mixed { paint: Arc::clone(&self.paints[k]), notes }),
            None => self.drawn(weights, part),
        }
    }

    fn check(&self, weights: &[f64]) -> Result<Vec<String>, MixError> {
        let n = self.paints.len();
        if weights.len() != n || n > 16 {
            return Err(MixError::WeightCount { found: weights.len(), paints: n });
        }
        if let Some(place) = weights.iter().position(|w| !(-10.0..=10.0).contains(w)) {
            return Err(MixError::Weight { place, found: weights[place] });
        }
        let mut notes = Vec::new();
        let sum: f64 = weights.iter().sum();
        if (sum - 1.0).abs() > 1e-9 {
            notes.push(format!(
                "the weights sum to {sum}, not to 1: the mixture is brighter or darker by that"
            ));
        }
        if weights.iter().any(|w| *w < 0.0 || *w > 1.0) {
            notes.push("weights outside of 0 … 1: extrapolated".to_owned());
        }
        Ok(notes)
    }

    /// The mixture with its flakes drawn from statistics, at whole weights too: all pictures of a row then look alike.
    ///
    /// # Errors
    /// As [`Mixable::mix`].
    pub fn drawn(&self, weights: &[f64], part: Part) -> Result<Mixed, MixError> {
        let mut notes = self.check(weights)?;
        let mut numbers = Realisation::default();
        self.realise(weights, part, &mut numbers);
        let parts = self.analytic.parts(&numbers.coefficients, &numbers.chi, &mut notes)?;
        let flakes = if self.steps.is_empty() {
            None
        } else {
            let side = numbers.coefficients.last().copied().unwrap_or(1.0);
            let least = self
                .analytic
                .coefficients
                .iter()
                .filter_map(|c| c.last())
                .fold(f64::INFINITY, |m, s| m.min(*s));
            // extrapolated sides stay a length
            let side = side.max(0.1 * least);
            Some(Flakes::Statistics(FlakeDraws::new(Arc::new(self.statistics(&numbers)?), side)?))
        };
        let first = self.paints[0].parts();
        let paint = CarPaint::new(CarPaintParts {
            name: self.name(weights, part),
            through: first.through,
            flakes,
            ..parts
        })?;
        Ok(Mixed { paint: Arc::new(paint), notes })
    }

    /// Statistics of the flakes of a mixture; a box may have its corners exchanged where extrapolation turns it inside out.
    ///
    /// # Errors
    /// [`MixError::Statistics`] for corners that are not finite.
    pub fn statistics(&self, numbers: &Realisation) -> Result<FlakeStatistics, MixError> {
        let n = self.steps.len();
        let corner = |at: usize, plane: usize| numbers.corners[plane * n + at];
        let slices: Vec<Vec<Cluster>> = self
            .first
            .windows(2)
            .map(|w| {
                (w[0] as usize..w[1] as usize)
                    .map(|at| Cluster {
                        low: [0, 1, 2].map(|c| corner(at, c)),
                        high: [3, 4, 5].map(|c| corner(at, c)),
                        steps: self.steps[at],
                    })
                    .collect()
            })
            .collect();
        Ok(FlakeStatistics::new(self.half.clone(), self.incidence.clone(), &slices)?)
    }

    fn name(&self, weights: &[f64], part: Part) -> String {
        let mut words: Vec<String> = self
            .paints
            .iter()
            .zip(weights)
            .map(|(p, w)| format!("{:.4} {}", w, p.parts().name).trim().to_owned())
            .collect();
        if part != Part::Everything {
            words.push(format!("({})", part.name()));
        }
        words.join(" + ")
    }
}

/// `out = Σ w_k values_k`, the first two at once.
fn blend<'a>(out: &mut [f32], mut values: impl Iterator<Item = &'a [f32]>, weights: &[f64; 16]) {
    let (Some(a), Some(b)) = (values.next(), values.next()) else { return };
    let (wa, wb) = (weights[0] as f32, weights[1] as f32);
    for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
        *o = wa * a + wb * b;
    }
    for (c, w) in values.zip(&weights[2..]) {
        let w = *w as f32;
        if w != 0.0 {
            for (o, c) in out.iter_mut().zip(c) {
                *o += w * c;
            }
        }
    }
}
