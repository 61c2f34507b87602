//! Measured CSV: `theta_i_deg,theta_o_deg,phi_deg,r,g,b[,sigma_r,sigma_g,sigma_b][,flag]`, values in 1/sr at the node.
//!
//! Columns may stand in any order; lines that begin with `#` are passed over. A complete product grid (every combination of the angles
//! once, angles within 0…90° and 0…180°, at least two polar viewing angles) is read as a grid, anything else as scattered data.

use gonio_optics::Geometry;

use super::{Problem, csv_rows::Rows};
use crate::{Flag, Grid, Meaning, Measured, Rgb, Scattered, ScatteredPoint};

const ANGLES: [&str; 3] = ["theta_i_deg", "theta_o_deg", "phi_deg"];
const VALUES: [&str; 3] = ["r", "g", "b"];
const SIGMAS: [&str; 3] = ["sigma_r", "sigma_g", "sigma_b"];

/// What a measured CSV holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Contents {
    /// A complete product grid.
    Table(Box<Measured>),
    /// Anything else.
    Scattered(Scattered),
}

/// Reads a measured CSV.
///
/// # Errors
/// [`Problem::Line`] with line, column, what was found and what would be accepted.
pub fn read(text: &[u8]) -> Result<Contents, Problem> {
    let mut rows = Rows::new(text)?;
    let angles = rows.required(ANGLES)?;
    let values = rows.required(VALUES)?;
    let sigmas = rows.optional(SIGMAS)?;
    let flags = rows.find("flag");
    let mut degrees: Vec<[f64; 3]> = Vec::new();
    let mut scattered = Scattered::default();
    while rows.advance()? {
        let flag = flags.map_or(Ok(Flag::Measured), |k| rows.flag(k))?;
        let a = rows.angles(angles)?;
        let number = |k: usize| {
            if flag == Flag::Invalid {
                rows.any_number(k)
            } else {
                rows.number(k, "a finite number", f64::is_finite)
            }
        };
        let value = [number(values[0])?, number(values[1])?, number(values[2])?];
        let uncertainty =
            |k: usize| rows.number(k, "a finite number, not negative", |x| x.is_finite() && x >= 0.0);
        let sigma = match sigmas {
            Some(k) if flag != Flag::Invalid => {
                Some([uncertainty(k[0])?, uncertainty(k[1])?, uncertainty(k[2])?])
            }
            Some(k) => Some([rows.any_number(k[0])?, rows.any_number(k[1])?, rows.any_number(k[2])?]),
            None => None,
        };
        degrees.push(a);
        scattered.points.push(ScatteredPoint {
            geometry: Geometry::from_degrees(a[0], a[1], a[2]),
            value,
            sigma,
            flag,
        });
    }
    if scattered.points.is_empty() {
        return Err(Problem::line(
            rows.line(),
            ANGLES[0],
            "the end of the file",
            "at least one row of numbers",
        ));
    }
    Ok(match places(&degrees) {
        Some((grid, places)) => Contents::Table(Box::new(table(grid, &places, &scattered))),
        None => Contents::Scattered(scattered),
    })
}

/// The grid of the rows and each row's place in it, if they fill it once.
fn places(degrees: &[[f64; 3]]) -> Option<(Grid, Vec<usize>)> {
    let axis = |k: usize| {
        let mut nodes: Vec<f64> = degrees.iter().map(|d| d[k]).collect();
        nodes.sort_by(f64::total_cmp);
        nodes.dedup();
        nodes
    };
    let grid = Grid { theta_i_deg: axis(0), theta_o_deg: axis(1), phi_deg: axis(2) };
    let cells = grid.shape().iter().try_fold(1usize, |n, &s| n.checked_mul(s))?;
    if cells != degrees.len() || grid.shape()[1] < 2 || grid.check().is_err() {
        return None;
    }
    let find = |nodes: &[f64], x: f64| nodes.binary_search_by(|n| n.total_cmp(&x)).ok();
    let mut seen = vec![false; cells];
    let mut places = Vec::with_capacity(cells);
    for d in degrees {
        let i = grid.index(
            find(&grid.theta_i_deg, d[0])?,
            find(&grid.theta_o_deg, d[1])?,
            find(&grid.phi_deg, d[2])?,
        );
        if std::mem::replace(seen.get_mut(i)?, true) {
            return None;
        }
        places.push(i);
    }
    Some((grid, places))
}

fn table(grid: Grid, places: &[usize], scattered: &Scattered) -> Measured {
    let mut m = Measured::empty(grid, Meaning::Node);
    let narrow = |v: Rgb| v.map(|x| x as f32);
    for (&i, p) in places.iter().zip(&scattered.points) {
        m.values[i] = narrow(p.value);
        m.sigma[i] = p.sigma.map_or([0.0; 3], narrow);
        m.flag[i] = p.flag;
    }
    m
}

/// The text of a table. Columns sigma are left out where the table has none (all zero), the flag where all cells are measured.
#[must_use]
pub fn write(table: &Measured) -> String {
    // f32 prints the fewest digits that come back as the same number
    let values = table.node.as_ref().unwrap_or(&table.values);
    let sigma = table.sigma.iter().flatten().any(|&s| s != 0.0);
    let flag = table.flag.iter().any(|&f| f != Flag::Measured);
    let mut out = header(sigma, flag);
    for (i, value) in values.iter().enumerate().take(table.grid.len()) {
        let [ti, to, phi] = table.grid.coordinates(i);
        let g = &table.grid;
        let angles = [g.theta_i_deg[ti], g.theta_o_deg[to], g.phi_deg[phi]].map(|a| a.to_string());
        let mut cells = angles.to_vec();
        cells.extend(value.iter().map(ToString::to_string));
        if sigma {
            cells.extend(table.sigma[i].iter().map(ToString::to_string));
        }
        if flag {
            cells.push((table.flag[i] as u8).to_string());
        }
        out.push_str(&cells.join(","));
        out.push('\n');
    }
    out
}

/// The text of scattered measurements.
#[must_use]
pub fn write_scattered(scattered: &Scattered) -> String {
    let sigma = scattered.points.iter().any(|p| p.sigma.is_some());
    let flag = scattered.points.iter().any(|p| p.flag != Flag::Measured);
    let mut out = header(sigma, flag);
    for p in &scattered.points {
        let g = p.geometry;
        let mut cells = [g.theta_i, g.theta_o, g.phi].map(|a| tidy(a.degrees()).to_string()).to_vec();
        cells.extend(p.value.iter().map(ToString::to_string));
        if sigma {
            cells.extend(p.sigma.unwrap_or([0.0; 3]).iter().map(ToString::to_string));
        }
        if flag {
            cells.push((p.flag as u8).to_string());
        }
        out.push_str(&cells.join(","));
        out.push('\n');
    }
    out
}

/// Degrees that went through radians, without the noise of the last digits.
fn tidy(degrees: f64) -> f64 {
    (degrees * 1e10).round() / 1e10
}

fn header(sigma: bool, flag: bool) -> String {
    let mut names = [ANGLES, VALUES].concat();
    if sigma {
        names.extend(SIGMAS);
    }
    if flag {
        names.push("flag");
    }
    names.join(",") + "\n"
}

#[cfg(test)]
mod tests;
