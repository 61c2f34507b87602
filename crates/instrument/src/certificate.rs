//! The certificate of a reference sample.

use serde::{Deserialize, Serialize};

/// What is known of a white reference or a black glass: who, until when, which BRDF and how surely.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// Serial number of the reference sample.
    pub serial: String,
    /// Date of issue, `YYYY-MM-DD`.
    pub issued: String,
    /// Last day of validity, `YYYY-MM-DD`.
    pub expires: String,
    /// Its BRDF: the text of a `model.json`, or a table as measured CSV (a product grid of geometries, 1/sr).
    pub brdf: String,
    /// Relative standard uncertainty (k = 1) of that BRDF.
    pub relative_uncertainty: f64,
}

impl Certificate {
    /// Whether the certificate has run out on `today` (`YYYY-MM-DD`; ISO dates compare as text).
    #[must_use]
    pub fn expired(&self, today: &str) -> bool {
        self.expires.as_str() < today
    }

    /// The virtual instrument's white: a perfect diffuser's 0.98, exact by construction and certified as such.
    #[must_use]
    pub fn virtual_white() -> Self {
        Self {
            serial: "virtual-white-1".to_owned(),
            issued: "2026-01-01".to_owned(),
            expires: "2099-12-31".to_owned(),
            brdf: r#"{"model":"lambert","diffuse":[0.98,0.98,0.98]}"#.to_owned(),
            relative_uncertainty: 0.0005,
        }
    }

    /// The virtual instrument's black: a matt diffuser's 0.03, exact by construction and certified as well as a black can be.
    #[must_use]
    pub fn virtual_black() -> Self {
        Self {
            serial: "virtual-black-1".to_owned(),
            brdf: r#"{"model":"lambert","diffuse":[0.03,0.03,0.03]}"#.to_owned(),
            relative_uncertainty: 0.002,
            ..Self::virtual_white()
        }
    }
}
