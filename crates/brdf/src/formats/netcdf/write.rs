//! A measured table to the bytes of a NetCDF file.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io;
use std::rc::Rc;

use netcdf3::{DataSet, FileWriter, Version};

use super::{DIGEST, FORMAT, FORMAT_VERSION, NAME, OURS, PART, RESERVED, classic, digest};
use crate::formats::Problem;
use crate::{Flag, Meaning, Measured};

const CELLS: [&str; 4] = ["theta_i", "theta_o", "phi", "channel"];
pub(super) const CHANNELS: [&[u8; 5]; 3] = [b"red  ", b"green", b"blue "];

/// The file of a table, the same bytes for the same table.
///
/// # Errors
/// [`Problem::Unsuitable`] where the table does not fit its own grid, holds a number that is not finite in a cell not flagged invalid,
/// or has an attribute whose name is reserved or not allowed.
pub fn write(table: &Measured) -> Result<Vec<u8>, Problem> {
    check(table)?;
    let definition = define(table).map_err(|e| unsuitable(format!("{e:?}")))?;
    let bytes = fill(&definition, table).map_err(|e| unsuitable(format!("{e:?}")))?;
    sealed(bytes)
}

/// The file with its digest in its place.
pub(super) fn sealed(mut bytes: Vec<u8>) -> Result<Vec<u8>, Problem> {
    let place = classic::parse(&bytes)?.attribute(DIGEST).map(|a| a.offset);
    if let Some((at, hex)) = place.and_then(|p| Some((p, digest::compute(&bytes, p)?))) {
        bytes[at..at + hex.len()].copy_from_slice(hex.as_bytes());
    }
    Ok(bytes)
}

pub(super) fn unsuitable(advice: String) -> Problem {
    Problem::Unsuitable { content: "this table".to_owned(), format: NAME, advice }
}

/// Everything that `fill` and a later reader rely on.
fn check(table: &Measured) -> Result<(), Problem> {
    let n = table.grid.len();
    if n == 0 {
        return Err(unsuitable("the grid has no cell".to_owned()));
    }
    table.grid.check().map_err(unsuitable)?;
    if table.flag.len() != n {
        return Err(unsuitable(format!("it has {} flags for {n} cells", table.flag.len())));
    }
    for (name, values) in arrays(table) {
        if values.len() != n {
            return Err(unsuitable(format!("{name} has {} cells, the grid {n}", values.len())));
        }
        let bad =
            (0..n).find(|&i| table.flag[i] != Flag::Invalid && values[i].iter().any(|v| !v.is_finite()));
        if let Some(i) = bad {
            let [ti, to, phi] = table.grid.coordinates(i);
            return Err(unsuitable(format!(
                "{name} is {:?} at theta_i {}, theta_o {}, phi {} degrees; flag the cell invalid or mend it",
                values[i], table.grid.theta_i_deg[ti], table.grid.theta_o_deg[to], table.grid.phi_deg[phi]
            )));
        }
    }
    check_attributes(&table.attributes)
}

/// No attribute may pass for one of the format's own.
pub(super) fn check_attributes(attributes: &BTreeMap<String, String>) -> Result<(), Problem> {
    for key in attributes.keys() {
        if key.starts_with(OURS) || RESERVED.contains(&key.as_str()) {
            return Err(unsuitable(format!("the attribute name {key} is reserved")));
        }
    }
    Ok(())
}

/// The variables of cells and channels in the order of the file.
fn arrays(table: &Measured) -> Vec<(String, &[[f32; 3]])> {
    let mut out = vec![("brdf".to_owned(), table.values.as_slice()), ("sigma".to_owned(), &table.sigma)];
    out.extend(table.base.iter().map(|v| ("brdf_base".to_owned(), v.as_slice())));
    out.extend(table.base_single_pass.iter().map(|v| ("brdf_base_single_pass".to_owned(), v.as_slice())));
    out.extend(table.node.iter().map(|v| ("brdf_node".to_owned(), v.as_slice())));
    out.extend(table.sigma_parts.iter().map(|(k, v)| (format!("{PART}{k}"), v.as_slice())));
    out
}

fn long_name(variable: &str) -> String {
    match variable {
        "brdf" => "bidirectional reflectance distribution function, without the cosine".to_owned(),
        "sigma" => "standard uncertainty of brdf (k = 1), all parts".to_owned(),
        "brdf_base" => "base coat under the clear coat, two-way form".to_owned(),
        "brdf_base_single_pass" => {
            "base coat under the clear coat, single-pass form, not reciprocal".to_owned()
        }
        "brdf_node" => "brdf at the nodes, derived from the cell means".to_owned(),
        part => format!("standard uncertainty of brdf (k = 1), part {}", part.trim_start_matches(PART)),
    }
}

fn define(table: &Measured) -> Result<DataSet, netcdf3::error::InvalidDataSet> {
    let mut d = DataSet::new();
    let [ni, no, np] = table.grid.shape();
    for (name, len) in [("theta_i", ni), ("theta_o", no), ("phi", np), ("channel", 3), ("bound", 2)] {
        d.add_fixed_dim(name, len)?;
    }
    d.add_fixed_dim("channel_name_length", CHANNELS[0].len())?;

    describe(&mut d, table.meaning, &table.attributes)?;

    for (name, text) in [
        ("theta_i", "angle of incidence"),
        ("theta_o", "polar angle of the view"),
        ("phi", "azimuth of the view against the light"),
    ] {
        d.add_var_f64(name, &[name])?;
        d.add_var_attr_string(name, "units", "degree")?;
        d.add_var_attr_string(name, "long_name", text)?;
    }
    for name in ["theta_o", "phi"] {
        let bounds = format!("{name}_bnds");
        d.add_var_attr_string(name, "bounds", &bounds)?;
        d.add_var_f64(&bounds, &[name, "bound"])?;
        d.add_var_attr_string(&bounds, "units", "degree")?;
    }
    d.add_var_u8("channel_name", &["channel", "channel_name_length"])?;
    for (name, _) in arrays(table) {
        d.add_var_f32(&name, &CELLS)?;
        d.add_var_attr_string(&name, "units", "sr-1")?;
        d.add_var_attr_string(&name, "long_name", long_name(&name))?;
        d.add_var_attr_string(&name, "coordinates", "channel_name")?;
    }
    d.add_var_attr_string("brdf", "ancillary_variables", "sigma flag")?;
    d.add_var_i8("flag", &CELLS[..3])?;
    d.add_var_attr_string("flag", "long_name", "what is known of the cell")?;
    d.add_var_attr_i8("flag", "flag_values", vec![0, 1, 2, 3])?;
    d.add_var_attr_string("flag", "flag_meanings", "measured filled extrapolated invalid")?;
    Ok(d)
}

/// The attributes of every file of ours.
pub(super) fn describe(
    d: &mut DataSet,
    meaning: Meaning,
    attributes: &BTreeMap<String, String>,
) -> Result<(), netcdf3::error::InvalidDataSet> {
    d.add_global_attr_string("gonio_format", FORMAT)?;
    d.add_global_attr_string("Conventions", "CF-1.8")?;
    match meaning {
        Meaning::Node => d.add_global_attr_string("value", "node")?,
        Meaning::CellMean { lamp_half_angle } => {
            d.add_global_attr_string("value", "cell_mean")?;
            d.add_global_attr_f64("lamp_half_angle_deg", vec![lamp_half_angle.degrees()])?;
        }
    }
    d.add_global_attr_string(
        "azimuth_convention",
        "phi = phi_o - phi_i; 0 is the light's side, 180 the mirror side",
    )?;
    d.add_global_attr_string("polar_convention", "angles from the outward normal of the sample")?;
    d.add_global_attr_string(
        "brdf_convention",
        "f in 1/sr, without the cosine; the reflectance factor is pi f",
    )?;
    d.add_global_attr_string("colour_space", "linear RGB, Rec. 709 primaries, D65")?;
    d.add_global_attr_string("gonio_format_version", FORMAT_VERSION)?;
    for (key, value) in attributes {
        d.add_global_attr_string(key, value)?;
    }
    d.add_global_attr_string(DIGEST, digest::BLANK)?;
    Ok(())
}

fn fill(definition: &DataSet, table: &Measured) -> Result<Vec<u8>, netcdf3::error::WriteError> {
    let memory = Memory::default();
    let mut w = FileWriter::open_seek_write("table", Box::new(memory.clone()))?;
    w.set_def(definition, Version::Offset64Bit, 0)?;
    let grid = &table.grid;
    w.write_var_f64("theta_i", &grid.theta_i_deg)?;
    w.write_var_f64("theta_o", &grid.theta_o_deg)?;
    w.write_var_f64("phi", &grid.phi_deg)?;
    w.write_var_f64("theta_o_bnds", &bounds(&grid.theta_o_deg))?;
    w.write_var_f64("phi_bnds", &bounds(&grid.phi_deg))?;
    w.write_var_u8("channel_name", &CHANNELS.iter().flat_map(|c| c.iter().copied()).collect::<Vec<_>>())?;
    for (name, values) in arrays(table) {
        w.write_var_f32(&name, values.as_flattened())?;
    }
    w.write_var_i8("flag", &table.flag.iter().map(|&f| f as i8).collect::<Vec<_>>())?;
    w.close()?;
    Ok(memory.take())
}

/// (low, high) of every bin, degrees.
pub(super) fn bounds(nodes: &[f64]) -> Vec<f64> {
    (0..nodes.len()).flat_map(|k| <[f64; 2]>::from(crate::grid::bounds_deg(nodes, k))).collect()
}

/// A file in memory that the writer may own while we keep a hand on it.
#[derive(Clone, Default)]
pub(super) struct Memory(Rc<RefCell<io::Cursor<Vec<u8>>>>);

impl Memory {
    /// What was written.
    pub(super) fn take(&self) -> Vec<u8> {
        self.0.borrow_mut().get_mut().split_off(0)
    }
}

impl io::Write for Memory {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().write(buffer)
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl io::Seek for Memory {
    fn seek(&mut self, to: io::SeekFrom) -> io::Result<u64> {
        self.0.borrow_mut().seek(to)
    }
}
