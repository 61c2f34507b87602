//! MERL `.binary` tables (Matusik et al. 2003): isotropic, by half and difference angles.
//!
//! ```text
//! i32 LE × 3   90 (θh), 90 (θd), 180 (φd)
//! f64 LE × 3 · 90 · 90 · 180    red, green, blue one after the other; times 1/1500, 1.15/1500, 1.66/1500 they are 1/sr
//! index = φd + 180 (θd + 90 θh);  θh bin = ⌊√(θh/90° · 90²)⌋ (finer near 0), θd bin = ⌊θd/1°⌋, φd bin = ⌊φd/1°⌋, φd modulo 180°
//! ```
//!
//! Values are looked up as the database's own program does, without interpolation. Negative entries mean "not measured": 0 here.

use std::f64::consts::{FRAC_PI_2, PI};

use gonio_optics::Vec3;

use super::{Problem, cursor::Cursor, half_difference::half_difference};
use crate::{Brdf, Rgb};

const NAME: &str = "MERL";
const SHAPE: [u32; 3] = [90, 90, 180];
const CELLS: usize = 90 * 90 * 180;
const SCALES: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];
/// Bytes of a file.
pub(super) const SIZE: u64 = 12 + 3 * CELLS as u64 * 8;

/// A table.
#[derive(Clone, Debug, PartialEq)]
pub struct Merl {
    /// Per cell, 1/sr.
    values: Vec<[f32; 3]>,
    /// Cells without a measurement in some channel.
    unmeasured: usize,
}

/// Whether the first bytes are the three sizes.
pub(super) fn is_merl(bytes: &[u8]) -> bool {
    let sizes = SHAPE.map(u32::to_le_bytes);
    bytes.get(..12) == Some(sizes.as_flattened())
}

/// Reads a table.
///
/// # Errors
/// [`Problem`] where the sizes are others, the length is not theirs, or a number is not finite.
pub fn read(bytes: &[u8]) -> Result<Merl, Problem> {
    let mut cursor = Cursor::new(NAME, bytes);
    let mut shape = [0; 3];
    for s in &mut shape {
        *s = cursor.u32_le("sizes")?;
    }
    if shape != SHAPE {
        return Err(Problem::malformed(NAME, "sizes", format!("{shape:?}"), format!("{SHAPE:?}")));
    }
    let mut values = vec![[0.0; 3]; CELLS];
    let mut unmeasured = vec![false; CELLS];
    for (c, scale) in SCALES.into_iter().enumerate() {
        let channel = cursor.f64s_le(["red", "green", "blue"][c], CELLS as u64)?;
        for (i, x) in channel.into_iter().enumerate() {
            let f = (x * scale) as f32;
            if !f.is_finite() {
                return Err(Problem::malformed(
                    NAME,
                    format!("channel {c}, value {i}"),
                    x,
                    "a finite number",
                ));
            }
            unmeasured[i] |= x < 0.0;
            values[i][c] = f.max(0.0);
        }
    }
    if cursor.left() > 0 {
        let expected = format!("{SIZE} bytes");
        return Err(Problem::malformed(NAME, "length", format!("{} bytes", bytes.len()), expected));
    }
    Ok(Merl { values, unmeasured: unmeasured.iter().filter(|&&u| u).count() })
}

impl Merl {
    /// Number of cells with a channel not measured, of 1,458,000.
    #[must_use]
    pub const fn unmeasured(&self) -> usize {
        self.unmeasured
    }
}

/// The bin of x in 0…1 among n; the upper end belongs to the last.
fn bin(x: f64, n: usize) -> usize {
    // a float to integer cast saturates, NaN is 0
    ((x * n as f64) as usize).min(n - 1)
}

impl Brdf for Merl {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z <= 0.0 || view.z <= 0.0 {
            return [0.0; 3];
        }
        let (h, d) = half_difference(light, view);
        let theta_h = h.x.atan2(h.z) / FRAC_PI_2;
        let theta_d = d.x.hypot(d.y).atan2(d.z) / FRAC_PI_2;
        let phi_d = d.y.atan2(d.x).rem_euclid(PI) / PI;
        let i = bin(phi_d, 180) + 180 * (bin(theta_d, 90) + 90 * bin(theta_h.max(0.0).sqrt(), 90));
        self.values[i].map(f64::from)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use gonio_optics::Geometry;

    /// A file whose value tells its cell: θh bin + 0.01 θd bin in red (raw), 1500 in green, −1 (not measured) in blue.
    pub(crate) fn file() -> Vec<u8> {
        let mut b: Vec<u8> = SHAPE.iter().flat_map(|s| s.to_le_bytes()).collect();
        for i in 0..CELLS {
            b.extend(((i / 16200) as f64 + 0.01 * (i / 180 % 90) as f64).to_le_bytes());
        }
        (0..CELLS).for_each(|_| b.extend(1500f64.to_le_bytes()));
        (0..CELLS).for_each(|_| b.extend((-1f64).to_le_bytes()));
        b
    }

    #[test]
    fn cells_are_found_by_half_and_difference_angle_and_channels_are_scaled() {
        let m = read(&file()).unwrap();
        assert_eq!(m.unmeasured(), CELLS);
        let at = |i, o, p| {
            let (l, v) = Geometry::from_degrees(i, o, p).directions();
            m.eval(l, v)
        };
        // mirror pair at 30.5°: θh = 0, θd = 30.5°; retro pair at 30°: θh = 30° (bin ⌊√(30·90)⌋ = 51), θd = 0
        let f = at(30.5, 30.5, 180.0);
        assert!((f[0] - 0.30 / 1500.0).abs() < 1e-9 && (f[1] - 1.15).abs() < 1e-6 && f[2] == 0.0, "{f:?}");
        assert!((at(30.0, 30.0, 0.0)[0] - 51.0 / 1500.0).abs() < 1e-8);
        assert_eq!(at(0.0, 90.1, 0.0), [0.0; 3]);
    }

    #[test]
    fn other_sizes_lengths_and_numbers_are_refused() {
        let good = file();
        assert!(matches!(read(&good[..good.len() - 1]), Err(Problem::Truncated { .. })));
        assert!(read(&[&good[..], &[0]].concat()).is_err());
        let mut bad = good.clone();
        bad[0] = 91;
        assert!(matches!(read(&bad), Err(Problem::Malformed { .. })));
        let mut bad = good;
        bad[12..20].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(read(&bad).is_err());
    }
}
