//! Sections of a report and the tables that every measurement has.

use super::number::{plus_minus, significant};
use crate::picture::Picture;

/// A heading with what stands under it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// The heading.
    pub heading: String,
    /// A paragraph that says how to read it; may be empty.
    pub intro: String,
    /// Tables and pictures.
    pub blocks: Vec<Block>,
}

/// Something that stands in a section.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// Names and values in two columns.
    Facts(Vec<Fact>),
    /// A table; the first column holds names, the others numbers. Rows may be shorter than the head.
    Table {
        /// Above the table; may be empty.
        caption: String,
        /// Column heads.
        head: Vec<String>,
        /// Rows.
        rows: Vec<Vec<String>>,
    },
    /// Pictures one below the other.
    Pictures(Vec<Figure>),
}

/// One line of a list of facts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fact {
    /// What.
    pub name: String,
    /// The value with its unit.
    pub value: String,
}

impl Fact {
    /// A fact.
    #[must_use]
    pub fn new(name: impl Into<String>, value: impl Into<String>) -> Self {
        Self { name: name.into(), value: value.into() }
    }
}

/// A picture with its words.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name of the PNG file, without the ending: letters, digits, `-`, `_`.
    pub name: String,
    /// The picture.
    pub picture: Picture,
    /// Under the picture: what it shows and how to read it.
    pub caption: String,
    /// For those who cannot see it: what the picture says.
    pub alt: String,
}

/// A value with its standard uncertainty (k = 1), where one is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// One standard uncertainty.
    pub sigma: Option<f64>,
}

/// A fitted parameter: one estimate, or one for each channel R, G, B.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name with its symbol, such as "diffuse, cd".
    pub name: String,
    /// One or three estimates.
    pub estimates: Vec<Estimate>,
    /// Unit, empty for none.
    pub unit: String,
}

/// A colour difference over a set of cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourDifference {
    /// Mean CIEDE2000.
    pub mean: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
    /// Cells compared.
    pub cells: usize,
}

impl Block {
    /// Parameters with uncertainties: a column for a single value or three for R, G, B.
    #[must_use]
    pub fn parameters(parameters: &[Parameter]) -> Self {
        let coloured = parameters.iter().any(|p| p.estimates.len() > 1);
        let head: &[&str] = if coloured { &["Parameter", "R", "G", "B"] } else { &["Parameter", "Value"] };
        let rows = parameters
            .iter()
            .map(|p| {
                let name =
                    if p.unit.is_empty() { p.name.clone() } else { format!("{} ({})", p.name, p.unit) };
                std::iter::once(name)
                    .chain(p.estimates.iter().map(|e| plus_minus(e.value, e.sigma)))
                    .collect()
            })
            .collect();
        Self::Table {
            caption: "Value ± standard uncertainty (k = 1)".into(),
            head: head.iter().map(|s| (*s).to_owned()).collect(),
            rows,
        }
    }

    /// Colour differences, one row for each set of cells: within and beyond 15° of the mirror direction, all, …
    #[must_use]
    pub fn colour_differences(rows: &[(String, ColourDifference)]) -> Self {
        let head = ["Cells", "mean", "95th percentile", "max", "number"];
        Self::Table {
            caption: "Colour difference CIEDE2000 between measurement and model".into(),
            head: head.map(str::to_owned).to_vec(),
            rows: rows
                .iter()
                .map(|(name, d)| {
                    let number = |x: f64| significant(x, 3);
                    vec![name.clone(), number(d.mean), number(d.p95), number(d.max), d.cells.to_string()]
                })
                .collect(),
        }
    }
}
