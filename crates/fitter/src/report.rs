//! A fit as the `"fit"` key of a `model.json`.

use gonio_brdf::ModelFile;
use serde_json::{Map, Value, json};

use crate::{Fit, Status};

/// A number, or null where JSON has none.
fn number(x: f64) -> Value {
    serde_json::Number::from_f64(x).map_or(Value::Null, Value::Number)
}

impl Fit {
    /// The model file of this fit, its report under `"fit"` ([`Fit::to_json`]).
    #[must_use]
    pub fn to_model_file(&self) -> ModelFile {
        ModelFile { model: self.model.clone(), coat: self.coat, fit: Some(self.to_json()) }
    }

    /// The report: `status`, `at_bound` (names), `weights`, `loss`, `error`, `unweighted_error` (1/sr), `delta_e` ({all, within_15_deg, beyond_15_deg}:
    /// {mean, p95, max, cells}), `parameters` ({name: {value, sigma}}), `covariance` (rows in the order of `parameter_names`), `condition`,
    /// `notes` (what the model cannot follow), `inseparable` ([name, name, correlation]), `sentence`, `cells_used`, `cells_left_out`. Numbers that do not exist are null.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let parameters: Map<String, Value> = self
            .parameters
            .iter()
            .map(|p| {
                let entry = json!({"value": number(p.value), "sigma": p.sigma.map(number)});
                (p.name.to_owned(), entry)
            })
            .collect();
        let covariance: Vec<Vec<Value>> =
            self.covariance.iter().map(|row| row.iter().copied().map(number).collect()).collect();
        let at_bound: &[&str] = if let Status::AtBound(names) = &self.status { names } else { &[] };
        json!({
            "status": self.status.name(),
            "at_bound": at_bound,
            "weights": self.weights.name(),
            "loss": self.loss.name(),
            "error": number(self.weighted_error),
            "unweighted_error": number(self.unweighted_error),
            "delta_e": serde_json::to_value(self.delta_e).unwrap_or(Value::Null),
            "parameter_names": self.parameters.iter().map(|p| p.name).collect::<Vec<_>>(),
            "parameters": parameters,
            "covariance": covariance,
            "condition": number(self.condition),
            "notes": self.notes,
            "inseparable": self.inseparable.iter().map(|(a, b, r)| json!([a, b, number(*r)])).collect::<Vec<_>>(),
            "sentence": self.sentence(),
            "cells_used": self.cells_used,
            "cells_left_out": self.cells_left_out,
        })
    }
}
