//! Published car paints as rows of a CSV: Lambert and three Cook–Torrance lobes without a coat (Günther et al. 2005, table 1).
//!
//! ```text
//! name,kd_r,kd_g,kd_b,ks1_r,ks1_g,ks1_b,ks2_r,…,ks3_b,R1,R2,R3,M1,M2,M3
//! ```
//!
//! ks belong to the lobe F·D·G/(π cos cos) of 1982 with D = exp(−tan²/m²)/(m² cos⁴), four times the modern one, so they are multiplied by 4 ([`lobe_from_1982`]).
//! Their third lobe is the coat's own gloss, as narrow as the surface is smooth, so directions are not refracted.

use gonio_brdf::models::CookTorranceLobe;

use super::{CarPaint, CarPaintError, CarPaintParts, Through};

/// A lobe whose s belongs to the form of 1982, s/π·D·F·G/(cos cos) (Golla & Klein 2018, eq. 1; Ngan; Günther), in the modern normalisation.
#[must_use]
pub fn lobe_from_1982(specular: [f64; 3], alpha: f64, r0: f64) -> CookTorranceLobe {
    CookTorranceLobe { specular: specular.map(|s| 4.0 * s), alpha, r0 }
}

const COLUMNS: [&str; 19] = [
    "name", "kd_r", "kd_g", "kd_b", "ks1_r", "ks1_g", "ks1_b", "ks2_r", "ks2_g", "ks2_b", "ks3_r", "ks3_g",
    "ks3_b", "R1", "R2", "R3", "M1", "M2", "M3",
];

/// Rows with their line numbers, comments and the heading left out.
fn rows(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    text.trim_start_matches('\u{feff}')
        .lines()
        .enumerate()
        .map(|(k, l)| (k + 1, l.trim()))
        .filter(|(_, l)| !l.is_empty() && !l.starts_with('#'))
        .map(|(k, l)| (k, l.split(',').map(str::trim).collect()))
}

/// Whether a text is such a table.
#[must_use]
pub fn is_guenther(text: &str) -> bool {
    rows(text).next().is_some_and(|(_, heading)| heading == COLUMNS)
}

/// Names of the paints in a table.
#[must_use]
pub fn guenther_names(text: &str) -> Vec<String> {
    rows(text).skip(1).filter_map(|(_, row)| row.first().map(|n| (*n).to_owned())).collect()
}

/// The paint of a name; an empty name takes the only one there is.
///
/// # Errors
/// [`CarPaintError::Unknown`] with the names that are there, [`CarPaintError::Line`] with the place of a number that is none.
pub fn read_guenther(text: &str, name: &str) -> Result<CarPaint, CarPaintError> {
    let names = guenther_names(text);
    let only = name.is_empty() && names.len() == 1;
    let (line, row) = rows(text)
        .skip(1)
        .find(|(_, row)| only || row.first() == Some(&name))
        .ok_or_else(|| CarPaintError::Unknown { name: name.to_owned(), known: names.join(", ") })?;
    let number = |k: usize| -> Result<f64, CarPaintError> {
        let found = row.get(k).copied().unwrap_or("nothing");
        found.parse().ok().filter(|x: &f64| x.is_finite() && *x >= 0.0).ok_or_else(|| CarPaintError::Line {
            line,
            column: COLUMNS[k].to_owned(),
            found: found.to_owned(),
            expected: "a finite number, not below 0",
        })
    };
    let colour =
        |k: usize| -> Result<[f64; 3], CarPaintError> { Ok([number(k)?, number(k + 1)?, number(k + 2)?]) };
    let mut lobes = Vec::with_capacity(3);
    for k in 0..3 {
        let lobe = lobe_from_1982(colour(4 + 3 * k)?, number(16 + k)?, number(13 + k)?);
        if lobe.specular != [0.0; 3] {
            lobes.push(lobe);
        }
    }
    CarPaint::new(CarPaintParts {
        name: row[0].to_owned(),
        coat: None,
        through: Through::TwoWay,
        diffuse: colour(1)?,
        lobes,
        colour: None,
        flakes: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::Brdf as _;
    use gonio_optics::Geometry;

    const TABLE: &str = "# made up\nname,kd_r,kd_g,kd_b,ks1_r,ks1_g,ks1_b,ks2_r,ks2_g,ks2_b,ks3_r,ks3_g,ks3_b,R1,R2,R3,M1,M2,M3\n\
        night,0.1,0.2,0.3,0.01,0.02,0.03,0,0,0,0.004,0.005,0.006,0.5,0.9,0.1,0.3,0.2,0.05\n\
        broken,0.1,0.2,x,0,0,0,0,0,0,0,0,0,0,0,0,0.3,0.2,0.05\n";

    #[test]
    fn a_row_has_the_value_of_the_published_form() {
        let paint = read_guenther(TABLE, "night").expect("sound");
        assert_eq!(paint.parts().lobes.len(), 2, "a black lobe is none");
        let (l, v) = Geometry::from_degrees(30.0, 40.0, 160.0).directions();
        let h = (l + v).normalized();
        // the form of 1982, written out from the paper
        let f82 = |ks: f64, r: f64, m: f64| {
            let (c, hv) = (h.z, h.dot(v));
            let d = ((c * c - 1.0) / (m * m * c * c)).exp() / (m * m * c.powi(4));
            let f = r + (1.0 - r) * (1.0 - hv).powi(5);
            let g = 1.0f64.min(2.0 * c * v.z / hv).min(2.0 * c * l.z / hv);
            ks / std::f64::consts::PI * d * f * g / (l.z * v.z)
        };
        let expected = 0.2 / std::f64::consts::PI + f82(0.02, 0.5, 0.3) + f82(0.005, 0.1, 0.05);
        let found = paint.eval(l, v)[1];
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    }

    #[test]
    fn names_and_numbers_that_are_none_are_told() {
        assert!(is_guenther(TABLE) && !is_guenther("theta_i_deg,theta_o_deg\n1,2"));
        let unknown = read_guenther(TABLE, "day").expect_err("unknown").to_string();
        assert!(unknown.contains("night, broken"), "{unknown}");
        let line = read_guenther(TABLE, "broken").expect_err("broken").to_string();
        assert!(line.contains("line 4, column kd_b: found x"), "{line}");
        assert!(read_guenther(TABLE, "").is_err());
    }
}
