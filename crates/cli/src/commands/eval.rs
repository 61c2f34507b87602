//! `gonio eval`: f at the geometries of a CSV file.

use std::fmt::Write;
use std::path::Path;

use gonio_brdf::formats::{self, geometry_csv};
use serde_json::json;

use crate::arguments::EvalArguments;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer};

/// Appends r,g,b (1/sr) to every geometry.
///
/// # Errors
/// [`Failure::Usage`] for files that cannot be read, a representation that is not known, scattered data.
pub fn run(a: &EvalArguments, printer: Printer) -> Result<Outcome, Failure> {
    if a.representation != "table" {
        return Err(Failure::usage(format!(
            "--as {}: this version evaluates tables and models as they are (--as table)",
            a.representation
        )));
    }
    output::check_free(&a.output, a.force)?;
    output::check_apart(&a.output, &[Path::new(&a.input), &a.geometries])?;
    let loaded = formats::open(Path::new(&a.input)).map_err(Failure::usage)?;
    let brdf = loaded.as_brdf().ok_or_else(|| {
        Failure::usage(format!(
            "{} holds scattered geometries, nothing in between; fit a model to it first",
            a.input
        ))
    })?;
    let geometries = geometry_csv::open(&a.geometries).map_err(Failure::usage)?;
    let mut text = String::from("theta_i_deg,theta_o_deg,phi_deg,r,g,b\n");
    for g in &geometries {
        let (l, v) = g.directions();
        let [r, green, b] = brdf.eval(l, v);
        let _ = writeln!(
            text,
            "{},{},{},{r},{green},{b}",
            g.theta_i.degrees(),
            g.theta_o.degrees(),
            g.phi.degrees()
        );
    }
    output::write_whole(&a.output, text.as_bytes())?;
    printer.result(
        &format!("{} geometries, written to {}", geometries.len(), a.output.display()),
        &json!({ "geometries": geometries.len(), "output": output::shown(&a.output) }),
    );
    Ok(Outcome::Done)
}
