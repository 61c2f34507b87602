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
