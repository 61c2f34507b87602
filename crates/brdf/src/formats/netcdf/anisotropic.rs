//! Tables over four angles: the azimuth of the light on the sample comes first, φ runs over the whole circle.

use netcdf3::{DataSet, FileWriter, Version};

use super::classic::{self, Attribute};
use super::read::{Reader, check_digest, plain};
use super::write::{CHANNELS, Memory, check_attributes, describe, sealed, unsuitable};
use super::{NAME, OURS, RESERVED};
use crate::formats::Problem;
use crate::{Anisotropic, Flag, Grid};

const CELLS: [&str; 5] = ["phi_i", "theta_i", "theta_o", "phi", "channel"];

/// Whether a file holds more than one azimuth of the light.
#[must_use]
pub fn has_azimuths(bytes: &[u8]) -> bool {
    classic::parse(bytes).is_ok_and(|f| f.dimensions.iter().any(|d| d.0 == "phi_i" && d.1 > 1))
}

/// The file of a table, the same bytes for the same table.
///
/// # Errors
/// [`Problem::Unsuitable`] where axes and arrays do not fit, or an attribute has a name of the format's own.
pub fn write(table: &Anisotropic) -> Result<Vec<u8>, Problem> {
    table.check().map_err(unsuitable)?;
    check_attributes(&table.attributes)?;
    let bad = (0..table.values.len()).find(|&i| {
        let all = table.values[i].iter().chain(&table.sigma[i]);
        table.flag[i] != Flag::Invalid && all.into_iter().any(|v| !v.is_finite())
    });
    if let Some(i) = bad {
        return Err(unsuitable(format!("cell {i} holds {:?}; flag it invalid or mend it", table.values[i])));
    }
    let definition = define(table).map_err(|e| unsuitable(format!("{e:?}")))?;
    sealed(fill(&definition, table).map_err(|e| unsuitable(format!("{e:?}")))?)
}

fn axes(table: &Anisotropic) -> [(&'static str, &[f64], &'static str); 4] {
    [
        ("phi_i", &table.phi_i_deg, "azimuth of the light on the sample, from its x axis"),
        ("theta_i", &table.grid.theta_i_deg, "angle of incidence"),
        ("theta_o", &table.grid.theta_o_deg, "polar angle of the view"),
        ("phi", &table.grid.phi_deg, "azimuth of the view against the light, round the circle"),
    ]
}

fn define(table: &Anisotropic) -> Result<DataSet, netcdf3::error::InvalidDataSet> {
    let mut d = DataSet::new();
    for (name, nodes, _) in axes(table) {
        d.add_fixed_dim(name, nodes.len())?;
    }
    d.add_fixed_dim("channel", 3)?;
    d.add_fixed_dim("channel_name_length", CHANNELS[0].len())?;
    describe(&mut d, table.meaning, &table.attributes)?;
    for (name, _, text) in axes(table) {
        d.add_var_f64(name, &[name])?;
        d.add_var_attr_string(name, "units", "degree")?;
        d.add_var_attr_string(name, "long_name", text)?;
    }
    d.add_var_u8("channel_name", &["channel", "channel_name_length"])?;
    for (name, text) in [
        ("brdf", "bidirectional reflectance distribution function, without the cosine"),
        ("sigma", "standard uncertainty of brdf (k = 1), all parts"),
    ] {
        d.add_var_f32(name, &CELLS)?;
        d.add_var_attr_string(name, "units", "sr-1")?;
        d.add_var_attr_string(name, "long_name", text)?;
        d.add_var_attr_string(name, "coordinates", "channel_name")?;
    }
    d.add_var_attr_string("brdf", "ancillary_variables", "sigma flag")?;
    d.add_var_i8("flag", &CELLS[..4])?;
    d.add_var_attr_string("flag", "long_name", "what is known of the cell")?;
    d.add_var_attr_i8("flag", "flag_values", vec![0, 1, 2, 3])?;
    d.add_var_attr_string("flag", "flag_meanings", "measured filled extrapolated invalid")?;
    Ok(d)
}

fn fill(definition: &DataSet, table: &Anisotropic) -> Result<Vec<u8>, netcdf3::error::WriteError> {
    let memory = Memory::default();
    let mut w = FileWriter::open_seek_write("table", Box::new(memory.clone()))?;
    w.set_def(definition, Version::Offset64Bit, 0)?;
    for (name, nodes, _) in axes(table) {
        w.write_var_f64(name, nodes)?;
    }
    w.write_var_u8("channel_name", &CHANNELS.iter().flat_map(|c| c.iter().copied()).collect::<Vec<_>>())?;
    w.write_var_f32("brdf", table.values.as_flattened())?;
    w.write_var_f32("sigma", table.sigma.as_flattened())?;
    w.write_var_i8("flag", &table.flag.iter().map(|&f| f as i8).collect::<Vec<_>>())?;
    w.close()?;
    Ok(memory.take())
}

/// Reads a table over four angles: ours, digest checked, or one with `brdf` over phi_i, theta_i, theta_o, phi, channel in this order.
///
/// # Errors
/// As [`super::read()`].
pub fn read(bytes: &[u8]) -> Result<Anisotropic, Problem> {
    let file = classic::parse(bytes)?;
    let ours = check_digest(&file, bytes)?;
    let reader = Reader { file: &file, ours };
    let grid = Grid {
        theta_i_deg: reader.axis("theta_i")?,
        theta_o_deg: reader.axis("theta_o")?,
        phi_deg: reader.axis("phi")?,
    };
    let phi_i_deg = reader.axis("phi_i")?;
    let meaning = reader.meaning()?;
    let lengths: Vec<usize> = std::iter::once(phi_i_deg.len()).chain(grid.shape()).chain([3]).collect();
    let numbers = |name: &str| -> Result<Option<Vec<f64>>, Problem> {
        let Some(v) = file.variable(name) else { return Ok(None) };
        let names = if name == "flag" { &CELLS[..4] } else { &CELLS[..] };
        let strides = reader.strides(v, names, &lengths[..names.len()])?;
        if strides.windows(2).any(|w| w[0] < w[1]) {
            let found = file.dimension_names(v).join(", ");
            return Err(Problem::malformed(NAME, format!("dimensions of {name}"), found, CELLS.join(", ")));
        }
        file.numbers(v).map(Some)
    };
    let triples = |v: &[f64]| -> Vec<[f32; 3]> {
        v.chunks_exact(3).map(|c| [c[0] as f32, c[1] as f32, c[2] as f32]).collect()
    };
    let brdf = numbers("brdf")?
        .ok_or_else(|| Problem::malformed(NAME, "list of variables", "no brdf", "one named brdf"))?;
    let values = triples(&brdf);
    let sigma = numbers("sigma")?.map_or_else(|| vec![[0.0; 3]; values.len()], |v| triples(&v));
    let mut flag = match numbers("flag")? {
        None => vec![Flag::Measured; values.len()],
        Some(bytes) => bytes
            .iter()
            .enumerate()
            .map(|(at, &x)| {
                let byte = if (0.0..=3.0).contains(&x) && x.fract() == 0.0 { x as u8 } else { u8::MAX };
                Flag::from_byte(byte)
                    .ok_or_else(|| Problem::malformed(NAME, format!("flag[{at}]"), x, "0, 1, 2 or 3"))
            })
            .collect::<Result<_, _>>()?,
    };
    let mut values = values;
    for (v, f) in values.iter_mut().zip(&mut flag) {
        if v.iter().any(|x| !x.is_finite()) {
            (*v, *f) = ([0.0; 3], Flag::Invalid);
        }
    }
    let attributes = file
        .attributes
        .iter()
        .filter(|a: &&Attribute<'_>| !a.name.starts_with(OURS) && !RESERVED.contains(&a.name.as_str()))
        .map(|a| (a.name.clone(), plain(a)))
        .collect();
    let table = Anisotropic { phi_i_deg, grid, meaning, values, sigma, flag, attributes };
    table.check().map_err(|found| {
        Problem::malformed(
            NAME,
            "table",
            found,
            "increasing angles, azimuths within 0…360°, arrays of their size",
        )
    })?;
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Meaning;
    use crate::anisotropic::both_sides;
    use gonio_optics::Angle;

    fn table() -> Anisotropic {
        let grid = Grid {
            theta_i_deg: vec![0.0, 30.0],
            theta_o_deg: vec![0.0, 20.0, 40.0],
            phi_deg: both_sides(&[0.0, 60.0, 120.0, 180.0]),
        };
        let lamp_half_angle = Angle::from_degrees(0.5);
        let mut t = Anisotropic::empty(vec![0.0, 90.0, 180.0], grid, Meaning::CellMean { lamp_half_angle });
        for k in 0..t.values.len() {
            t.values[k] = [k as f32, 0.5, 1.0 / (1 + k) as f32];
            t.sigma[k] = [0.1; 3];
            t.flag[k] = if k % 5 == 4 { Flag::Invalid } else { Flag::Measured };
        }
        t.attributes.insert("sample_name".to_owned(), "brushed".to_owned());
        t
    }

    #[test]
    fn a_table_comes_back_and_any_flipped_bit_is_told() {
        let (table, bytes) = (table(), write(&table()).expect("written"));
        assert!(has_azimuths(&bytes));
        assert_eq!(read(&bytes).expect("read"), table);
        assert_eq!(write(&table).expect("again"), bytes);
        for at in (0..bytes.len()).step_by(7) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << (at % 8);
            assert!(read(&damaged).is_err(), "byte {at}");
        }
        for n in 0..bytes.len() {
            assert!(read(&bytes[..n]).is_err(), "{n} bytes");
        }
        let plain = crate::formats::netcdf::read(&bytes).expect_err("three angles").to_string();
        assert!(plain.contains("anisotropic"), "{plain}");
    }
}
