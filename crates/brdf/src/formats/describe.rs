//! A short account of what a file holds.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{Format, Loaded};
use crate::{Flag, Grid, Meaning, Measured, Scattered};

/// What a file holds, for people and programs; keys that do not apply are left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// `table`, `scattered`, `function` or `model`.
    pub content: &'static str,
    /// Of a function: its format.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<Format>,
    /// Name of the material or model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Of a table: its axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid: Option<Axes>,
    /// `node` or `cell_mean`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<&'static str>,
    /// Of cell means: angular radius of the lamp.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lamp_half_angle_deg: Option<f64>,
    /// Number of cells or points by what is known of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<Cells>,
    /// Smallest and largest f per channel over the valid ones, 1/sr.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<[[f64; 3]; 2]>,
    /// Whether any uncertainty is stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub has_sigma: Option<bool>,
    /// Further variables of a table.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub also: Vec<String>,
    /// A model with its parameters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<serde_json::Value>,
    /// Attributes and notes.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub attributes: BTreeMap<String, String>,
}

/// First node, last node and number of nodes along each axis, degrees.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Axes {
    /// Angles of incidence.
    pub theta_i_deg: (f64, f64, usize),
    /// Polar viewing angles.
    pub theta_o_deg: (f64, f64, usize),
    /// Azimuths.
    pub phi_deg: (f64, f64, usize),
}

/// How many of each flag.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Cells {
    /// All.
    pub total: usize,
    /// Measured.
    pub measured: usize,
    /// Filled.
    pub filled: usize,
    /// Extrapolated.
    pub extrapolated: usize,
    /// Without a value.
    pub invalid: usize,
}

impl Loaded {
    /// The account.
    #[must_use]
    pub fn describe(&self) -> Summary {
        match self {
            Self::Table(t) => table(t),
            Self::Scattered(s) => scattered(s),
            Self::Function(f) => Summary {
                content: "function",
                format: Some(f.format),
                name: Some(f.name.clone()),
                attributes: f.notes.clone(),
                ..Summary::default()
            },
            Self::Model(m) => Summary {
                content: "model",
                name: Some(m.model.name().to_owned()),
                model: serde_json::to_value(m.as_ref()).ok(),
                ..Summary::default()
            },
        }
    }
}

fn table(t: &Measured) -> Summary {
    let (value, lamp) = match t.meaning {
        Meaning::Node => ("node", None),
        Meaning::CellMean { lamp_half_angle } => ("cell_mean", Some(lamp_half_angle.degrees())),
    };
    let mut also = Vec::new();
    also.extend(t.base.is_some().then(|| "brdf_base".to_owned()));
    also.extend(t.node.is_some().then(|| "brdf_node".to_owned()));
    also.extend(t.sigma_parts.keys().map(|k| format!("sigma_{k}")));
    let values = t.values.iter().zip(&t.flag).map(|(v, &f)| (v.map(f64::from), f));
    Summary {
        content: "table",
        grid: Some(axes(&t.grid)),
        value: Some(value),
        lamp_half_angle_deg: lamp,
        cells: Some(count(t.flag.iter().copied())),
        range: range(values),
        has_sigma: Some(t.sigma.iter().flatten().any(|&s| s > 0.0)),
        also,
        attributes: t.attributes.clone(),
        ..Summary::default()
    }
}

fn scattered(s: &Scattered) -> Summary {
    Summary {
        content: "scattered",
        value: Some("node"),
        cells: Some(count(s.points.iter().map(|p| p.flag))),
        range: range(s.points.iter().map(|p| (p.value, p.flag))),
        has_sigma: Some(s.points.iter().any(|p| p.sigma.is_some())),
        ..Summary::default()
    }
}

fn axes(g: &Grid) -> Axes {
    let axis = |nodes: &[f64]| {
        (nodes.first().copied().unwrap_or(f64::NAN), nodes.last().copied().unwrap_or(f64::NAN), nodes.len())
    };
    Axes { theta_i_deg: axis(&g.theta_i_deg), theta_o_deg: axis(&g.theta_o_deg), phi_deg: axis(&g.phi_deg) }
}

fn count(flags: impl Iterator<Item = Flag>) -> Cells {
    let mut c = Cells::default();
    for flag in flags {
        c.total += 1;
        *match flag {
            Flag::Measured => &mut c.measured,
            Flag::Filled => &mut c.filled,
            Flag::Extrapolated => &mut c.extrapolated,
            Flag::Invalid => &mut c.invalid,
        } += 1;
    }
    c
}

fn range(values: impl Iterator<Item = ([f64; 3], Flag)>) -> Option<[[f64; 3]; 2]> {
    values.filter(|v| v.1 != Flag::Invalid).fold(None, |r, (v, _)| {
        let [low, high] = r.unwrap_or([v, v]);
        Some([[0, 1, 2].map(|c| low[c].min(v[c])), [0, 1, 2].map(|c| high[c].max(v[c]))])
    })
}
