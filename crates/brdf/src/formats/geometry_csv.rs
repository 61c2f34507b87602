//! Geometry CSV: `theta_i_deg,theta_o_deg,phi_deg`, one geometry a line; other columns are passed over.

use gonio_optics::Geometry;

use super::{FormatError, Problem, csv_rows::Rows};

/// Geometries in the order of the file.
///
/// # Errors
/// [`Problem::Line`] with line, column, what was found and what would be accepted.
pub fn read(text: &[u8]) -> Result<Vec<Geometry>, Problem> {
    let mut rows = Rows::new(text)?;
    let columns = rows.required(["theta_i_deg", "theta_o_deg", "phi_deg"])?;
    let mut out = Vec::new();
    while rows.advance()? {
        let [theta_i, theta_o, phi] = rows.angles(columns)?;
        out.push(Geometry::from_degrees(theta_i, theta_o, phi));
    }
    Ok(out)
}

/// [`read`] on a file.
///
/// # Errors
/// [`FormatError`] with the path.
pub fn open(path: &std::path::Path) -> Result<Vec<Geometry>, FormatError> {
    super::read_file(path).and_then(|text| read(&text).map_err(|p| FormatError::new(path, p)))
}

/// The azimuth of the light on the sample (degrees) at each geometry: the column `phi_i_deg`, 0 where there is none. It matters for samples that look different
/// when turned.
///
/// # Errors
/// As [`read`].
pub fn read_azimuths(text: &[u8]) -> Result<Option<Vec<f64>>, Problem> {
    let mut rows = Rows::new(text)?;
    let Some(column) = rows.find("phi_i_deg") else { return Ok(None) };
    let mut out = Vec::new();
    while rows.advance()? {
        out.push(rows.number(column, "a finite number of degrees", f64::is_finite)?);
    }
    Ok(Some(out))
}

/// [`read_azimuths`] on a file.
///
/// # Errors
/// [`FormatError`] with the path.
pub fn open_azimuths(path: &std::path::Path) -> Result<Option<Vec<f64>>, FormatError> {
    super::read_file(path).and_then(|text| read_azimuths(&text).map_err(|p| FormatError::new(path, p)))
}

/// Geometries with the share that each has in a scene: the column `weight`, 1 each where there is none.
///
/// # Errors
/// As [`read`]; a weight that is negative or not finite, or weights that are all 0.
pub fn read_weighted(text: &[u8]) -> Result<Vec<(Geometry, f64)>, Problem> {
    let mut rows = Rows::new(text)?;
    let columns = rows.required(["theta_i_deg", "theta_o_deg", "phi_deg"])?;
    let weights = rows.find("weight");
    let mut out = Vec::new();
    while rows.advance()? {
        let [theta_i, theta_o, phi] = rows.angles(columns)?;
        let weight = weights.map_or(Ok(1.0), |k| {
            rows.number(k, "a finite number, not negative", |x| x.is_finite() && x >= 0.0)
        })?;
        out.push((Geometry::from_degrees(theta_i, theta_o, phi), weight));
    }
    if out.iter().all(|g| g.1 == 0.0) {
        let found = if out.is_empty() { "the end of the file" } else { "weights that are all 0" };
        return Err(Problem::line(rows.line(), "weight", found, "at least one geometry that counts"));
    }
    Ok(out)
}

/// [`read_weighted`] on a file.
///
/// # Errors
/// [`FormatError`] with the path.
pub fn open_weighted(path: &std::path::Path) -> Result<Vec<(Geometry, f64)>, FormatError> {
    super::read_file(path).and_then(|text| read_weighted(&text).map_err(|p| FormatError::new(path, p)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geometries_come_in_order_and_other_columns_are_passed_over() {
        let g = read(
            b"\xef\xbb\xbfphi_deg, theta_i_deg,name,theta_o_deg\n# a comment\n180,30,x,40\r\n0,1e1,y,0\n",
        )
        .unwrap();
        assert_eq!(g, [Geometry::from_degrees(30.0, 40.0, 180.0), Geometry::from_degrees(10.0, 0.0, 0.0)]);
    }

    #[test]
    fn weights_are_read_where_there_are_any() {
        let head = "theta_i_deg,theta_o_deg,phi_deg";
        let g = read_weighted(format!("{head},weight\n1,2,3,0.5\n1,2,4,0\n").as_bytes()).unwrap();
        assert_eq!((g.len(), g[0].1, g[1].1), (2, 0.5, 0.0));
        assert_eq!(read_weighted(format!("{head}\n1,2,3\n").as_bytes()).unwrap()[0].1, 1.0);
        for (rows, said) in [("1,2,3,-1", "\"-1\""), ("1,2,3,0", "all 0"), ("1,2,3,inf", "\"inf\"")] {
            let e = read_weighted(format!("{head},weight\n{rows}\n").as_bytes()).unwrap_err().to_string();
            assert!(e.contains(said) && e.contains("weight"), "{e}");
        }
        assert!(read_weighted(head.as_bytes()).is_err());
    }

    #[test]
    fn what_is_wrong_is_told_with_line_column_and_limits() {
        let message = |text: &str| read(text.as_bytes()).unwrap_err().to_string();
        assert_eq!(
            message("theta_i_deg,theta_o_deg,phi_deg\n10,20,30\n10,120,0\n"),
            "line 3, column theta_o_deg: found \"120\", expected degrees, 0 to 90"
        );
        assert_eq!(
            message("theta_i_deg,theta_o_deg\n10,20\n"),
            "line 1, column phi_deg: found the columns theta_i_deg, theta_o_deg, expected a column of this name"
        );
        assert_eq!(
            message("theta_i_deg,theta_o_deg,phi_deg\n10,20\n"),
            "line 2, column phi_deg: found 2 fields, expected 3 fields as in the header"
        );
        assert!(message("theta_i_deg,theta_o_deg,phi_deg\n10,NaN,2\n").contains("found \"NaN\""));
        assert!(message("").contains("line 1"));
    }
}
