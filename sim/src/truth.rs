//! The truth of a virtual sample: a `model.json`, a paint of single flakes (TOML) or a measured table (native NetCDF or CSV grid), told apart by content and checked.

use std::path::Path;
use std::sync::Arc;

use gonio_brdf::formats::{self, FormatError, Problem, measured_csv, netcdf};
use gonio_brdf::{Flag, Measured, ModelError, ModelFile};

use crate::flakes::{Field, FlakePaint, FlakePaintError};
use crate::optics::Sample;

/// A truth that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TruthError {
    /// The file cannot be opened.
    #[error("truth {0}")]
    File(#[from] FormatError),
    /// The table in it cannot be read.
    #[error("truth: {0}")]
    Table(#[from] Problem),
    /// Not a usable model.
    #[error("truth: {0}")]
    Model(#[from] ModelError),
    /// Not a usable flake paint.
    #[error("truth: {0}")]
    Flakes(#[from] FlakePaintError),
    /// Neither a model nor a table.
    #[error(
        "truth begins with {beginning:?}: expected a model.json, a flake paint (TOML), a measured .nc of this program or a measured CSV grid; convert it with `gonio convert`"
    )]
    Unknown {
        /// The first bytes, as text.
        beginning: String,
    },
    /// A CSV that is no product grid.
    #[error(
        "truth holds scattered points, which have no value in between: give a product grid, or fit a model to it first (`gonio fit`)"
    )]
    Scattered,
    /// A value no surface can have.
    #[error(
        "truth has f = {value} 1/sr in channel {channel} at theta_i {theta_i_deg:.2}°, theta_o {theta_o_deg:.2}°, phi {phi_deg:.2}°: a BRDF is finite and not negative; correct the table"
    )]
    Value {
        /// What stands there.
        value: f32,
        /// 0 red, 1 green, 2 blue.
        channel: usize,
        /// Node.
        theta_i_deg: f64,
        /// Node.
        theta_o_deg: f64,
        /// Node.
        phi_deg: f64,
    },
    /// Cells without a value.
    #[error(
        "truth has {count} of {total} cells without a value, the first at theta_i {theta_i_deg:.2}°, theta_o {theta_o_deg:.2}°, phi {phi_deg:.2}°: fill the table first"
    )]
    Holes {
        /// How many.
        count: usize,
        /// Of how many.
        total: usize,
        /// Node.
        theta_i_deg: f64,
        /// Node.
        theta_o_deg: f64,
        /// Node.
        phi_deg: f64,
    },
}

/// What a virtual sample is made of.
#[derive(Clone, Debug)]
pub enum Truth {
    /// An analytic model, with a coat where the file has one.
    Model(Box<ModelFile>),
    /// A table, interpolated between its nodes. A gloss in it stays as wide as its nodes make it.
    Table(Box<Measured>),
    /// A paint of single flakes.
    Flakes(Arc<Field>),
}

impl Truth {
    /// Reads and checks a truth file.
    ///
    /// # Errors
    /// [`TruthError`] that says what is wrong and where.
    pub fn open(path: &Path) -> Result<Self, TruthError> {
        Self::from_bytes(&formats::read_file(path)?)
    }

    /// Reads and checks the bytes of a truth file.
    ///
    /// # Errors
    /// [`TruthError`] that says what is wrong and where.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, TruthError> {
        if bytes.starts_with(b"CDF") {
            return Self::checked(netcdf::read(bytes)?);
        }
        let text = std::str::from_utf8(bytes).ok().map(str::trim_start);
        match text {
            Some(t) if t.starts_with('{') => Ok(Self::Model(Box::new(ModelFile::from_json(t)?))),
            Some(t) if FlakePaint::is_one(t) => {
                Ok(Self::Flakes(Arc::new(Field::new(FlakePaint::from_toml(t)?)?)))
            }
            Some(t) if t.starts_with("theta_i_deg") => match measured_csv::read(bytes)? {
                measured_csv::Contents::Table(table) => Self::checked(*table),
                measured_csv::Contents::Scattered(_) => Err(TruthError::Scattered),
            },
            _ => {
                let beginning = String::from_utf8_lossy(bytes.get(..16).unwrap_or(bytes)).into_owned();
                Err(TruthError::Unknown { beginning })
            }
        }
    }

    fn checked(table: Measured) -> Result<Self, TruthError> {
        let node = |i: usize| {
            let [ti, to, phi] = table.grid.coordinates(i);
            let g = table.grid.geometry(ti, to, phi);
            (g.theta_i.degrees(), g.theta_o.degrees(), g.phi.degrees())
        };
        let mut holes = (0..table.flag.len()).filter(|&i| table.flag[i] == Flag::Invalid);
        if let Some(first) = holes.next() {
            let (theta_i_deg, theta_o_deg, phi_deg) = node(first);
            let (count, total) = (1 + holes.count(), table.flag.len());
            return Err(TruthError::Holes { count, total, theta_i_deg, theta_o_deg, phi_deg });
        }
        for (i, rgb) in table.values.iter().enumerate() {
            for (channel, &value) in rgb.iter().enumerate() {
                if !(value >= 0.0 && value.is_finite()) {
                    let (theta_i_deg, theta_o_deg, phi_deg) = node(i);
                    return Err(TruthError::Value { value, channel, theta_i_deg, theta_o_deg, phi_deg });
                }
            }
        }
        Ok(Self::Table(Box::new(table)))
    }

    /// The sample to put on the holder.
    #[must_use]
    pub fn sample(&self) -> Sample {
        match self {
            Self::Model(file) => Sample::model((**file).clone()),
            Self::Table(table) => Sample::table((**table).clone()),
            Self::Flakes(field) => Sample::flakes(field),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::Grid;

    #[test]
    fn a_negative_albedo_is_named() {
        let e = Truth::from_bytes(br#"{"model":"lambert","diffuse":[0.5,-0.1,0.5]}"#)
            .expect_err("no surface has a negative albedo")
            .to_string();
        assert!(e.contains("diffuse") && e.contains("-0.1"), "{e}");
    }

    #[test]
    fn a_table_with_a_negative_value_or_a_hole_says_where() {
        let model = ModelFile::from_json(r#"{"model":"lambert","diffuse":[0.5,0.5,0.5]}"#).expect("a model");
        let good = Measured::sampled(Grid::sopp(), &model);
        assert!(Truth::checked(good.clone()).is_ok());
        let at = good.grid.index(3, 2, 1);
        let mut bad = good.clone();
        bad.values[at][2] = -1e-3;
        let e = Truth::checked(bad).expect_err("negative").to_string();
        assert!(e.contains("theta_i 15.00") && e.contains("theta_o 5.00") && e.contains("channel 2"), "{e}");
        let mut bad = good;
        bad.flag[at] = Flag::Invalid;
        let e = Truth::checked(bad).expect_err("a hole").to_string();
        assert!(e.contains("1 of") && e.contains("theta_i 15.00"), "{e}");
    }

    #[test]
    fn a_stranger_is_refused_with_what_would_be_accepted() {
        for stranger in [&b""[..], b"\x89PNG\r\n\x1a\n0000000000", b"hello"] {
            let e = Truth::from_bytes(stranger).expect_err("no truth").to_string();
            assert!(e.contains("model.json"), "{e}");
        }
    }
}
