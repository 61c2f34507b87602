//! NVIDIA MDL `.mbsdf`: a measured isotropic BSDF as a regular table.
//!
//! ```text
//! text lines, among them     NVIDIA ARC MBSDF V1
//! MBSDF_DATA_REFLECTION=\n   (or MBSDF_DATA=\n), then a block; a block MBSDF_DATA_TRANSMISSION=\n may follow and is passed over
//! block: u32 LE type (0 scalar, 1 RGB), u32 LE nθ, u32 LE nφ, f32 LE × channels at (iθin·nθ + iθout)·nφ + iφ
//! ```
//!
//! The SDK looks the table up as a texture over θ/90° and φ/180°, so entry k of n stands for the angle (k + ½)/n of that range.
//! φ = 0 is the light's side. Values are f without the cosine, in 1/sr.

use super::{Problem, cursor::Cursor, cursor::all_finite};
use crate::{Flag, Grid, Meaning, Measured};

const NAME: &str = "MBSDF";
/// What begins a block.
pub(super) const MARK: &[u8] = b"MBSDF_DATA";
const TRANSMISSION: &[u8] = b"MBSDF_DATA_TRANSMISSION";

/// Reads the table of reflection as node values.
///
/// # Errors
/// [`Problem`] with the place and what was expected.
pub fn read(bytes: &[u8]) -> Result<Measured, Problem> {
    let start = block(bytes)?;
    let mut cursor = Cursor::new(NAME, bytes);
    cursor.seek(start as u64);
    let channels: u64 = match cursor.u32_le("type")? {
        0 => 1,
        1 => 3,
        other => return Err(Problem::malformed(NAME, "type", other, "0 (scalar) or 1 (RGB)")),
    };
    let (n_theta, n_phi) = (cursor.u32_le("number of thetas")?, cursor.u32_le("number of phis")?);
    if n_theta == 0 || n_phi == 0 {
        return Err(Problem::malformed(
            NAME,
            "table size",
            format!("{n_theta} by {n_phi}"),
            "at least 1 by 1",
        ));
    }
    let cells = u64::from(n_theta).pow(2).saturating_mul(u64::from(n_phi));
    let values = cursor.f32s_le("table", cells.saturating_mul(channels))?;
    all_finite(NAME, "table", &values)?;

    // from here on the file has shown that it holds the table
    let centres =
        |n: u32, range: f64| (0..n).map(|k| (f64::from(k) + 0.5) / f64::from(n) * range).collect::<Vec<_>>();
    let theta = centres(n_theta, 90.0);
    let grid = Grid { theta_i_deg: theta.clone(), theta_o_deg: theta, phi_deg: centres(n_phi, 180.0) };
    let mut m = Measured::empty(grid, Meaning::Node);
    m.values = if channels == 3 {
        values.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect()
    } else {
        values.iter().map(|&v| [v; 3]).collect()
    };
    m.flag.fill(Flag::Measured);
    Ok(m)
}

/// Where the numbers of the block of reflection begin.
fn block(bytes: &[u8]) -> Result<usize, Problem> {
    let mut at = 0;
    loop {
        let rest = bytes.get(at..).unwrap_or_default();
        let line = rest.iter().position(|&b| b == b'\n').map(|n| &rest[..n]);
        match line {
            Some(line) if line.starts_with(MARK) && !line.starts_with(TRANSMISSION) => {
                return Ok(at + line.len() + 1);
            }
            // text before the mark is short; what comes after one is binary
            Some(line) if at + line.len() < 65_536 && !line.starts_with(TRANSMISSION) => at += line.len() + 1,
            _ => {
                let expected = "a line MBSDF_DATA_REFLECTION= within the first 64 KiB";
                return Err(Problem::malformed(NAME, "text", "no such line", expected));
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(crate) fn file(channels: u32) -> Vec<u8> {
        let mut b = b"NVIDIA ARC MBSDF V1\nMBSDF_DATA_REFLECTION=\n".to_vec();
        [u32::from(channels == 3), 3, 4].iter().for_each(|n| b.extend(n.to_le_bytes()));
        (0..3 * 3 * 4 * channels).for_each(|k| b.extend((k as f32).to_le_bytes()));
        b
    }

    #[test]
    fn entries_stand_at_the_centres_of_their_cells() {
        let m = read(&file(3)).unwrap();
        assert_eq!(m.grid.theta_o_deg, [15.0, 45.0, 75.0]);
        assert_eq!(m.grid.phi_deg, [22.5, 67.5, 112.5, 157.5]);
        assert_eq!(m.values[m.grid.index(1, 2, 3)], [69.0, 70.0, 71.0]);
        assert_eq!(read(&file(1)).unwrap().values[5], [5.0; 3]);
    }

    #[test]
    fn sizes_larger_than_the_file_cost_no_memory() {
        let mut b = file(3);
        let at = 43;
        for bad in [[0xff; 8], [0; 8]] {
            b[at + 4..at + 12].copy_from_slice(&bad);
            assert!(read(&b).is_err());
        }
        assert!(read(&file(3)[..60]).is_err() && read(b"MBSDF_DATA").is_err());
        let mut nan = file(3);
        nan[at + 12..at + 16].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(read(&nan).is_err());
    }
}
