//! What a table's colours are: those of the camera's channels, or taken through a matrix whose residual over its chart is known.

use std::collections::BTreeMap;

use gonio_render::report::{Notice, Weight};
use serde_json::{Value, json};

/// The residual over the chart, mean and largest CIEDE2000, as a table's attributes tell it; `None` without a chart.
fn residual(attributes: &BTreeMap<String, String>) -> Option<[f64; 2]> {
    let number = |key: &str| attributes.get(key)?.parse().ok();
    Some([number("colour_delta_e_mean")?, number("colour_delta_e_max")?])
}

/// In one line.
#[must_use]
pub fn line(attributes: &BTreeMap<String, String>) -> String {
    match residual(attributes) {
        Some([mean, max]) => format!(
            "colours went through the calibration's matrix: ΔE (CIEDE2000) left over its chart {mean:.2} on average, {max:.2} at most"
        ),
        None => "not colorimetric: colours are those of the camera's channels; a chart in the radiometric calibration tells how far off they are"
            .to_owned(),
    }
}

/// For programs: `colorimetric`, and what is left over the chart.
#[must_use]
pub fn to_json(attributes: &BTreeMap<String, String>) -> Value {
    let found = residual(attributes);
    json!({
        "colorimetric": found.is_some(), "delta_e_mean": found.map(|f| f[0]), "delta_e_max": found.map(|f| f[1]),
    })
}

/// For a report.
#[must_use]
pub fn notice(attributes: &BTreeMap<String, String>) -> Notice {
    let line = line(attributes);
    let mut letters = line.chars();
    let text = letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect());
    Notice { weight: Weight::Note, text: format!("{text}.") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_chart_nothing_is_colorimetric_and_with_one_what_is_left_is_told() {
        let mut attributes = BTreeMap::new();
        assert!(line(&attributes).starts_with("not colorimetric"));
        assert!(notice(&attributes).text.starts_with("Not colorimetric"));
        assert_eq!(to_json(&attributes)["colorimetric"], false);
        attributes.insert("colour_delta_e_mean".to_owned(), "0.731".to_owned());
        attributes.insert("colour_delta_e_max".to_owned(), "2.100".to_owned());
        assert!(line(&attributes).contains("0.73 on average, 2.10 at most"));
        assert_eq!(to_json(&attributes)["delta_e_max"], 2.1);
    }
}
