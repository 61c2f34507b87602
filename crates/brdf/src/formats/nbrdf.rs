//! Small networks fitted to measured materials (Sztrajman et al. 2021, "Neural BRDF representation"), many in one file.
//!
//! ```text
//! f32 LE per material: W1[6][21] b1[21] W2[21][21] b2[21] W3[21][3] b3[3]        675 numbers
//! input   (hx, hy, hz, dx, dy, dz), half and difference direction, φh = 0
//! layers  x ← max(0, x·W1 + b1), x ← max(0, x·W2 + b2), y = x·W3 + b3
//! output  max(exp y − 1, 0) is f in 1/sr
//! ```
//!
//! Names stand one a line in a text file beside: `x.f32` has `x.names.txt`. A material is asked for as `x.f32#NAME`.

use gonio_optics::Vec3;

use super::{Problem, cursor::Cursor, cursor::all_finite, half_difference::half_difference};
use crate::{Brdf, Rgb};

const NAME: &str = "neural BRDF";
const HIDDEN: usize = 21;
const WEIGHTS: usize = 6 * HIDDEN + HIDDEN + HIDDEN * HIDDEN + HIDDEN + HIDDEN * 3 + 3;
/// Bytes of one material.
pub(super) const SIZE: u64 = 4 * WEIGHTS as u64;

/// One material.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    /// In the order of the file.
    weights: Vec<f64>,
}

/// Names of a names file, one a line.
///
/// # Errors
/// [`Problem::Malformed`] where it is not text or its length does not belong to `bytes` of networks.
pub fn names(text: &[u8], bytes: u64) -> Result<Vec<String>, Problem> {
    let names: Vec<String> = String::from_utf8_lossy(text)
        .lines()
        .map(str::trim)
        .filter(|l| !l.is_empty())
        .map(str::to_owned)
        .collect();
    if bytes == 0 || names.len() as u64 * SIZE != bytes {
        let expected = format!("{SIZE} times the {} names of the names file", names.len());
        return Err(Problem::malformed(NAME, "number of bytes", bytes, expected));
    }
    Ok(names)
}

/// Reads one material by its name.
///
/// # Errors
/// [`Problem::Material`] for an unknown name, [`Problem`] where sizes do not agree or a weight is not finite.
pub fn read(bytes: &[u8], names: &[String], name: &str) -> Result<Network, Problem> {
    let Some(at) = names.iter().position(|n| n == name) else {
        let mut available = names.iter().take(12).cloned().collect::<Vec<_>>().join(", ");
        if names.len() > 12 {
            available.push_str(&format!(", … ({} in all)", names.len()));
        }
        return Err(Problem::Material { name: name.to_owned(), available });
    };
    let mut cursor = Cursor::new(NAME, bytes);
    cursor.seek(at as u64 * SIZE);
    let weights = cursor.f32s_le(name, WEIGHTS as u64)?;
    all_finite(NAME, "weight", &weights)?;
    Ok(Network { weights: weights.into_iter().map(f64::from).collect() })
}

/// `input·W + b`, weights and biases from the front of `weights`; returns what is left of these.
fn layer<const I: usize, const O: usize>(weights: &[f64], input: [f64; I]) -> ([f64; O], &[f64]) {
    let (matrix, rest) = weights.split_at(I * O);
    let (bias, rest) = rest.split_at(O);
    let mut out = [0.0; O];
    out.copy_from_slice(bias);
    for (x, row) in input.iter().zip(matrix.chunks_exact(O)) {
        for (o, w) in out.iter_mut().zip(row) {
            *o += x * w;
        }
    }
    (out, rest)
}

impl Brdf for Network {
    fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        if light.z < 0.0 || view.z < 0.0 {
            return [0.0; 3];
        }
        let (h, d) = half_difference(light, view);
        let relu = |x: [f64; HIDDEN]| x.map(|v| v.max(0.0));
        let (x, rest) = layer::<6, HIDDEN>(&self.weights, [h.x, h.y, h.z, d.x, d.y, d.z]);
        let (x, rest) = layer::<HIDDEN, HIDDEN>(rest, relu(x));
        let (y, _) = layer::<HIDDEN, 3>(rest, relu(x));
        // the exponent is held to what f32 can hold
        y.map(|v| v.clamp(0.0, 88.0).exp_m1())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use gonio_optics::Geometry;

    /// Two networks: the first is ln(1 + hz) in red, 0 in green, −1 in blue before the exponential; the second is constant 1.
    pub(crate) fn file() -> Vec<u8> {
        let mut first = vec![0f32; WEIGHTS];
        first[2 * HIDDEN] = 1.0; // hz to the first hidden unit
        first[6 * HIDDEN + HIDDEN] = 1.0; // on to the first of the second layer
        first[6 * HIDDEN + HIDDEN + HIDDEN * HIDDEN + HIDDEN] = 1.0; // and to red
        first[WEIGHTS - 1] = -1.0;
        let mut second = vec![0f32; WEIGHTS];
        second[WEIGHTS - 3..].fill(std::f32::consts::LN_2);
        [first, second].concat().iter().flat_map(|w| w.to_le_bytes()).collect()
    }

    #[test]
    fn layers_are_applied_in_their_order() {
        let bytes = file();
        let names = names(b"one\n two \n\n", bytes.len() as u64).unwrap();
        let (l, v) = Geometry::from_degrees(20.0, 80.0, 0.0).directions();
        let f = read(&bytes, &names, "one").unwrap().eval(l, v);
        assert!(
            (f[0] - (50f64.to_radians().cos().exp() - 1.0)).abs() < 1e-12 && f[1] == 0.0 && f[2] == 0.0,
            "{f:?}"
        );
        let f = read(&bytes, &names, "two").unwrap().eval(l, v);
        assert!(f.iter().all(|x| (x - 1.0).abs() < 1e-6), "{f:?}");
    }

    #[test]
    fn wrong_names_sizes_and_weights_are_refused() {
        let bytes = file();
        assert!(names(b"one", bytes.len() as u64).is_err() && names(b"", 0).is_err());
        let names = names(b"one\ntwo", bytes.len() as u64).unwrap();
        let text = read(&bytes, &names, "three").unwrap_err().to_string();
        assert!(text.contains("three") && text.contains("one, two"), "{text}");
        assert!(read(&bytes[..3000], &names, "two").is_err());
        let mut bad = bytes;
        bad[40..44].copy_from_slice(&f32::INFINITY.to_le_bytes());
        assert!(read(&bad, &names, "one").is_err());
    }
}
