//! A fit as the command line asks for it: names turned into options, results turned into words.

use gonio_brdf::formats::Loaded;
use gonio_brdf::{Flag, Grid, Measured};
use gonio_fitter::{CoatChoice, Fit, ModelChoice, Observations, Options, Weights};
use gonio_optics::Angle;

use crate::outcome::Failure;

/// What a file gives to fit: observations, and the table to draw (scattered data have none).
pub struct Subject {
    /// What is fitted.
    pub observations: Observations,
    /// What is drawn.
    pub table: Option<Measured>,
    /// Whether values carry standard uncertainties.
    pub has_sigma: bool,
    /// Refractive index of the clear coat that was separated when the table was made.
    pub coat_index: Option<f64>,
}

impl Subject {
    /// The observations of a file; functions are sampled on Sopp's grid.
    ///
    /// # Errors
    /// [`Failure::Usage`] for a file that holds a model already.
    pub fn of(loaded: &Loaded) -> Result<Self, Failure> {
        match loaded {
            Loaded::Model(_) => Err(Failure::usage(
                "this file holds a model already; give measurements, or use `gonio eval` and `gonio show` with it",
            )),
            Loaded::Scattered(points) => Ok(Self {
                observations: Observations::from_scattered(points),
                table: None,
                has_sigma: points.points.iter().any(|p| p.sigma.is_some()),
                coat_index: None,
            }),
            Loaded::Table(_) | Loaded::Function(_) => {
                let table = loaded
                    .to_measured(&Grid::sopp())
                    .ok_or_else(|| Failure::usage("this file holds nothing that can be evaluated"))?;
                Ok(Self::of_table(table))
            }
        }
    }

    /// The coat that the data ask for: the one separated when the table was made.
    #[must_use]
    pub fn coat(&self) -> CoatChoice {
        self.coat_index.map_or(CoatChoice::None, CoatChoice::Index)
    }

    /// The observations of a table.
    #[must_use]
    pub fn of_table(table: Measured) -> Self {
        let has_sigma = table
            .sigma
            .iter()
            .zip(&table.flag)
            .any(|(s, f)| *f == Flag::Measured && s.iter().any(|v| *v > 0.0));
        let separated = table.attributes.get("clear_coat").is_some_and(|c| c != "none");
        let coat_index =
            table.attributes.get("coat_index").filter(|_| separated).and_then(|n| n.parse().ok());
        Self { observations: Observations::from_measured(&table), table: Some(table), has_sigma, coat_index }
    }
}

/// Options from the words of the command line. Without a word for the weights: `sigma` where the data carry uncertainties, else `ngan`.
///
/// # Errors
/// [`Failure::Usage`] for an unknown model or an angle outside 0…90.
pub fn options(
    model: &str,
    weights: Option<Weights>,
    max_angle_deg: f64,
    has_sigma: bool,
) -> Result<Options, Failure> {
    if !(max_angle_deg > 0.0 && max_angle_deg <= 90.0) {
        return Err(Failure::usage(format!(
            "--max-angle-deg {max_angle_deg}: expected an angle above 0, at most 90"
        )));
    }
    let model: ModelChoice = model.parse().map_err(Failure::usage)?;
    let weights = weights.unwrap_or(if has_sigma { Weights::Sigma } else { Weights::Ngan });
    Ok(Options { model, weights, max_angle: Angle::from_degrees(max_angle_deg), ..Options::default() })
}

/// The model with its coat, in words.
#[must_use]
pub fn model_name(fit: &Fit) -> String {
    match fit.coat {
        Some(coat) => format!(
            "{} under a coat of index {}",
            fit.model.name(),
            gonio_render::report::significant(coat.index, 4)
        ),
        None => fit.model.name().to_owned(),
    }
}

/// What the status means, in plain words.
#[must_use]
pub fn verdict(fit: &Fit) -> String {
    fit.sentence()
}

/// Parameters as lines of text, three channels to a line.
#[must_use]
pub fn parameter_lines(fit: &Fit) -> String {
    use gonio_render::report::plus_minus;
    grouped(fit)
        .into_iter()
        .map(|(name, values)| {
            let numbers: Vec<String> = values.iter().map(|p| plus_minus(p.value, p.sigma)).collect();
            format!("  {name:<10} {}\n", numbers.join("   "))
        })
        .collect()
}

/// Parameters by name, colours gathered to three values in R, G, B order.
#[must_use]
pub fn grouped(fit: &Fit) -> Vec<(String, Vec<gonio_fitter::Parameter>)> {
    let mut groups: Vec<(String, Vec<gonio_fitter::Parameter>)> = Vec::new();
    for p in &fit.parameters {
        let name = p.name.trim_end_matches("_r").trim_end_matches("_g").trim_end_matches("_b");
        match groups.iter_mut().find(|g| g.0 == name) {
            Some(group) => group.1.push(*p),
            None => groups.push((name.to_owned(), vec![*p])),
        }
    }
    groups
}
