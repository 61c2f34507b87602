//! `gonio isoline`: in-plane geometries that see the same flakes.

use std::fmt::Write;

use gonio_brdf::formats::geometry_csv;
use gonio_optics::isoline::{Method, isoline};
use serde_json::json;

use crate::arguments::IsolineArguments;
use crate::outcome::{Failure, Outcome};
use crate::output::{self, Printer};

/// Appends the in-plane equivalent to every geometry of a CSV file.
///
/// # Errors
/// [`Failure::Usage`] for an unknown method, an index below 1, or a file that cannot be read or exists.
pub fn run(a: &IsolineArguments, printer: Printer) -> Result<Outcome, Failure> {
    let method: Method = a.method.parse().map_err(Failure::usage)?;
    if !(a.index >= 1.0 && a.index.is_finite()) {
        return Err(Failure::usage(format!("--index {}: expected a refractive index of 1 or more", a.index)));
    }
    output::check_free(&a.output, a.force)?;
    output::check_apart(&a.output, &[&a.geometries])?;
    let geometries = geometry_csv::open(&a.geometries).map_err(Failure::usage)?;
    let mut text = String::from(
        "theta_i_deg,theta_o_deg,phi_deg,theta_inc_deg,theta_flake_deg,theta_ill_deg,theta_det_deg,phi_det_deg,limited\n",
    );
    let mut limited = 0;
    for g in &geometries {
        let (l, v) = g.directions();
        let mut line = isoline(l, v, a.index, method);
        if a.exchanged {
            std::mem::swap(&mut line.theta_ill, &mut line.theta_det);
        }
        limited += usize::from(line.limited);
        let angles = [
            g.theta_i,
            g.theta_o,
            g.phi,
            line.flake.theta_inc,
            line.flake.theta_flake,
            line.theta_ill,
            line.theta_det,
            line.phi_det,
        ];
        for angle in angles {
            let _ = write!(text, "{},", angle.degrees());
        }
        let _ = writeln!(text, "{}", u8::from(line.limited));
    }
    output::write_whole(&a.output, text.as_bytes())?;
    printer.result(
        &format!(
            "{} geometries, {limited} beyond the critical angle; written to {}",
            geometries.len(),
            a.output.display()
        ),
        &json!({ "geometries": geometries.len(), "limited": limited, "exchanged": a.exchanged, "output": output::shown(&a.output) }),
    );
    Ok(Outcome::Done)
}
