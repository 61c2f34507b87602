//! The bytes of a NetCDF file to a measured table: ours, digest checked, or anybody's with the same variables.

use std::collections::BTreeMap;

use gonio_optics::Angle;

use super::classic::{self, Attribute, Classic, Variable};
use super::{DIGEST, FORMAT, FORMAT_VERSION, NAME, OURS, PART, RESERVED, digest, write};
use crate::formats::Problem;
use crate::{Flag, Grid, Meaning, Measured};

/// Reads a table.
///
/// Files of other programs need `brdf` over the dimensions `theta_i`, `theta_o`, `phi`, `channel` in any order and coordinate variables
/// of these names (degrees, or radians if `units` says so); `sigma`, `flag` and the rest may be missing. There, numbers that are not
/// finite and fill values become invalid cells of value 0.
///
/// # Errors
/// [`Problem::Digest`] where ours was changed, [`Problem::Truncated`] and [`Problem::Malformed`] with the place.
pub fn read(bytes: &[u8]) -> Result<Measured, Problem> {
    let file = classic::parse(bytes)?;
    let ours = check_digest(&file, bytes)?;
    let reader = Reader { file: &file, ours };
    let grid = reader.grid()?;
    let meaning = reader.meaning()?;
    if matches!(meaning, Meaning::CellMean { .. }) {
        reader.check_bounds("theta_o", &grid.theta_o_deg)?;
        reader.check_bounds("phi", &grid.phi_deg)?;
    }

    // first the values: only these show that the file is as large as its grid
    let brdf = file.variable("brdf").ok_or_else(|| {
        let names = file.variables.iter().map(|v| v.name.as_str()).collect::<Vec<_>>().join(", ");
        Problem::malformed(NAME, "list of variables", names, "one named brdf")
    })?;
    let mut unusable = Vec::new();
    let values = reader.cells(brdf, &grid, &mut unusable)?;
    let n = values.len();
    let mut optional = |name: &str| -> Result<Option<Vec<[f32; 3]>>, Problem> {
        file.variable(name).map(|v| reader.cells(v, &grid, &mut unusable)).transpose()
    };
    let sigma = optional("sigma")?.unwrap_or_else(|| vec![[0.0; 3]; n]);
    let base = optional("brdf_base")?;
    let base_single_pass = optional("brdf_base_single_pass")?;
    let node = optional("brdf_node")?;
    let mut sigma_parts = BTreeMap::new();
    for v in &file.variables {
        if let Some(part) = v.name.strip_prefix(PART)
            && let Some(values) = optional(&v.name)?
        {
            sigma_parts.insert(part.to_owned(), values);
        }
    }
    let mut flag = match file.variable("flag") {
        Some(v) => reader.flags(v, &grid)?,
        None => vec![Flag::Measured; n],
    };
    for i in unusable {
        flag[i] = Flag::Invalid;
    }
    let attributes = file
        .attributes
        .iter()
        .filter(|a| !a.name.starts_with(OURS) && !RESERVED.contains(&a.name.as_str()))
        .map(|a| (a.name.clone(), plain(a)))
        .collect();
    Ok(Measured { grid, meaning, values, sigma, flag, base, base_single_pass, node, sigma_parts, attributes })
}

/// Text of an attribute, numbers joined by spaces.
pub(super) fn plain(a: &Attribute<'_>) -> String {
    match a.text() {
        Some(t) => t.trim_end_matches('\0').to_owned(),
        None => a.numbers().iter().map(f64::to_string).collect::<Vec<_>>().join(" "),
    }
}

/// Whether the file is ours; if so its digest must be right.
pub(super) fn check_digest(file: &Classic<'_>, bytes: &[u8]) -> Result<bool, Problem> {
    if !file.attributes.iter().any(|a| a.name.starts_with(OURS)) {
        return Ok(false);
    }
    let text = |name: &str| file.attribute(name).and_then(Attribute::text);
    let stated = text(DIGEST).unwrap_or("absent").to_owned();
    let computed = file
        .attribute(DIGEST)
        .and_then(|a| digest::compute(bytes, a.offset))
        .unwrap_or_else(|| "no place for one".to_owned());
    if stated != computed {
        return Err(Problem::Digest { stated, computed });
    }
    let format = text("gonio_format").unwrap_or("absent");
    let version = text("gonio_format_version").unwrap_or("absent");
    if format != FORMAT || version != FORMAT_VERSION {
        let expected = format!("\"{FORMAT}\" version {FORMAT_VERSION}; a newer gonio may read it");
        return Err(Problem::malformed(NAME, "format", format!("\"{format}\" version {version}"), expected));
    }
    Ok(true)
}

pub(super) struct Reader<'a> {
    pub(super) file: &'a Classic<'a>,
    pub(super) ours: bool,
}

impl Reader<'_> {
    pub(super) fn axis(&self, name: &str) -> Result<Vec<f64>, Problem> {
        let v = self.file.variable(name).ok_or_else(|| {
            Problem::malformed(NAME, format!("coordinate variable {name}"), "absent", "the angles in degrees")
        })?;
        if self.file.dimension_names(v) != [name] {
            let found = self.file.dimension_names(v).join(", ");
            return Err(Problem::malformed(NAME, format!("dimensions of {name}"), found, name));
        }
        let mut nodes = self.file.numbers(v)?;
        let units = v.attribute("units").and_then(Attribute::text).unwrap_or("degree").trim();
        match units {
            "degree" | "degrees" | "deg" | "°" => {}
            "radian" | "radians" | "rad" => nodes.iter_mut().for_each(|x| *x = x.to_degrees()),
            other => {
                return Err(Problem::malformed(NAME, format!("units of {name}"), other, "degree or radian"));
            }
        }
        Ok(nodes)
    }

    fn grid(&self) -> Result<Grid, Problem> {
        if let Some((_, n)) = self.file.dimensions.iter().find(|d| d.0 == "phi_i" && d.1 > 1) {
            return Err(Problem::malformed(
                NAME,
                "dimension phi_i",
                n,
                "1: this is the table of an anisotropic sample, open it as such",
            ));
        }
        let grid = Grid {
            theta_i_deg: self.axis("theta_i")?,
            theta_o_deg: self.axis("theta_o")?,
            phi_deg: self.axis("phi")?,
        };
        grid.check().map_err(|found| {
            Problem::malformed(NAME, "grid", found, "increasing angles within 0…90° and 0…180°")
        })?;
        Ok(grid)
    }

    pub(super) fn meaning(&self) -> Result<Meaning, Problem> {
        match self.file.attribute("value").and_then(Attribute::text) {
            None | Some("node") => Ok(Meaning::Node),
            Some("cell_mean") => {
                let lamp =
                    self.file.attribute("lamp_half_angle_deg").map(Attribute::numbers).unwrap_or_default();
                match lamp.as_slice() {
                    [deg] if (0.0..90.0).contains(deg) => {
                        Ok(Meaning::CellMean { lamp_half_angle: Angle::from_degrees(*deg) })
                    }
                    other => Err(Problem::malformed(
                        NAME,
                        "lamp_half_angle_deg",
                        format!("{other:?}"),
                        "one number of degrees, 0 to 90 (value is cell_mean)",
                    )),
                }
            }
            Some(other) => Err(Problem::malformed(NAME, "attribute value", other, "node or cell_mean")),
        }
    }

    /// Bins are those between the nodes: others cannot be kept.
    fn check_bounds(&self, axis: &str, nodes: &[f64]) -> Result<(), Problem> {
        let Some(v) = self.file.variable(&format!("{axis}_bnds")) else { return Ok(()) };
        let found = self.file.numbers(v)?;
        let expected = write::bounds(nodes);
        if found.len() == expected.len() && found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6) {
            return Ok(());
        }
        Err(Problem::malformed(
            NAME,
            format!("{axis}_bnds"),
            "something else",
            "bins that end halfway between the nodes, and at the outermost nodes",
        ))
    }

    /// For each dimension of `v` which of `names` it is, after a check of lengths; `None` for others of length 1.
    pub(super) fn strides(
        &self,
        v: &Variable<'_>,
        names: &[&str],
        lengths: &[usize],
    ) -> Result<Vec<usize>, Problem> {
        let found = self.file.dimension_names(v);
        let shape = self.file.shape(v);
        let fits = found.len() == names.len()
            && names
                .iter()
                .zip(lengths)
                .all(|(n, &len)| found.iter().zip(&shape).any(|(f, &s)| f == n && s == len as u64));
        if !fits {
            let found =
                found.iter().zip(&shape).map(|(n, s)| format!("{n} {s}")).collect::<Vec<_>>().join(", ");
            let expected =
                names.iter().zip(lengths).map(|(n, s)| format!("{n} {s}")).collect::<Vec<_>>().join(", ");
            return Err(Problem::malformed(NAME, format!("dimensions of {}", v.name), found, expected));
        }
        let stride_of = |name: &&str| {
            let at = found.iter().position(|f| f == name).unwrap_or(0);
            lengths_after(&shape, at)
        };
        Ok(names.iter().map(stride_of).collect())
    }

    fn flags(&self, v: &Variable<'_>, grid: &Grid) -> Result<Vec<Flag>, Problem> {
        let strides = self.strides(v, &["theta_i", "theta_o", "phi"], &grid.shape())?;
        let numbers = self.file.numbers(v)?;
        let mut out = Vec::with_capacity(grid.len());
        for i in 0..grid.len() {
            let at: usize = grid.coordinates(i).iter().zip(&strides).map(|(c, s)| c * s).sum();
            let found = numbers.get(at).copied().unwrap_or(f64::NAN);
            let byte =
                if (0.0..=3.0).contains(&found) && found.fract() == 0.0 { found as u8 } else { u8::MAX };
            out.push(
                Flag::from_byte(byte)
                    .ok_or_else(|| Problem::malformed(NAME, format!("flag[{at}]"), found, "0, 1, 2 or 3"))?,
            );
        }
        Ok(out)
    }

    /// Cells and channels in the order of the grid; cells with a number that is not finite are 0 and told in `unusable`.
    fn cells(
        &self,
        v: &Variable<'_>,
        grid: &Grid,
        unusable: &mut Vec<usize>,
    ) -> Result<Vec<[f32; 3]>, Problem> {
        let [ni, no, np] = grid.shape();
        let strides = self.strides(v, &["theta_i", "theta_o", "phi", "channel"], &[ni, no, np, 3])?;
        let numbers = self.file.numbers(v)?;
        let fills = ["_FillValue", "missing_value"]
            .iter()
            .filter_map(|n| v.attribute(n))
            .flat_map(Attribute::numbers)
            .collect::<Vec<_>>();
        let mut out = Vec::with_capacity(grid.len());
        for i in 0..grid.len() {
            let at: usize = grid.coordinates(i).iter().zip(&strides).map(|(c, s)| c * s).sum();
            let cell = [0, 1, 2].map(|c| numbers.get(at + c * strides[3]).copied().unwrap_or(f64::NAN));
            let usable = |x: &f64| (*x as f32).is_finite() && !fills.contains(x);
            if self.ours || cell.iter().all(usable) {
                out.push(cell.map(|x| x as f32));
            } else {
                unusable.push(i);
                out.push([0.0; 3]);
            }
        }
        Ok(out)
    }
}

/// Product of the lengths after dimension `at`.
fn lengths_after(shape: &[u64], at: usize) -> usize {
    shape.iter().skip(at + 1).fold(1, |n, &s| n.saturating_mul(usize::try_from(s).unwrap_or(usize::MAX)))
}
