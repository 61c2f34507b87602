//! Which format some bytes are, by their content alone.

use serde::Serialize;

use super::{Problem, mbsdf, merl, nbrdf, rgl};

/// A format that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// NetCDF classic, ours or another program's.
    Netcdf,
    /// Measured CSV.
    MeasuredCsv,
    /// `model.json`.
    Model,
    /// RGL tensor file.
    Rgl,
    /// MERL binary table.
    Merl,
    /// Cornell spectral text.
    Cornell,
    /// MDL measured BSDF.
    Mbsdf,
    /// Networks fitted to measured materials.
    NeuralBrdf,
    /// Flake map, ours.
    FlakeMap,
    /// Car paint, ours; read by the paint crate.
    CarPaint,
}

impl Format {
    /// Name for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Netcdf => "NetCDF",
            Self::MeasuredCsv => "measured CSV",
            Self::Model => "model file",
            Self::Rgl => "RGL tensor file",
            Self::Merl => "MERL binary",
            Self::Cornell => "Cornell spectral text",
            Self::Mbsdf => "MDL measured BSDF",
            Self::NeuralBrdf => "neural BRDF",
            Self::FlakeMap => "flake map",
            Self::CarPaint => "car paint",
        }
    }
}

const KNOWN: &str = "NetCDF classic (.nc), measured CSV (theta_i_deg,theta_o_deg,phi_deg,r,g,b,…), model.json, flake maps (.json), car paints (.paint), RGL tensor files (_rgb.bsdf), MERL \
                     .binary, Cornell .brdf, MDL .mbsdf, and neural BRDFs with a .names.txt beside";

/// First bytes of a car paint.
const CAR_PAINT: &[u8] = b"gonio-paint\n";

/// How much of a text is looked at.
const HEAD: usize = 65_536;

/// The format of `bytes`; `named` says whether a file of material names lies beside (networks carry no mark of their own).
///
/// # Errors
/// [`Problem::Unknown`] with the first bytes and what would be accepted.
pub fn detect(bytes: &[u8], named: bool) -> Result<Format, Problem> {
    if bytes.starts_with(b"CDF") && matches!(bytes.get(3), Some(1 | 2 | 5)) {
        return Ok(Format::Netcdf);
    }
    if bytes.starts_with(b"\x89HDF\r\n\x1a\n") {
        let expected = "NetCDF classic: convert with `nccopy -k classic IN OUT`, or write with xarray's to_netcdf(engine=\"scipy\")";
        return Err(Problem::malformed("NetCDF", "container", "NetCDF-4 (HDF5)", expected));
    }
    if bytes.starts_with(CAR_PAINT) {
        return Ok(Format::CarPaint);
    }
    if bytes.starts_with(rgl::MAGIC) {
        return Ok(Format::Rgl);
    }
    if merl::is_merl(bytes) {
        return Ok(Format::Merl);
    }
    let head = &bytes[..bytes.len().min(HEAD)];
    if head.split(|&b| b == b'\n').any(|l| l.starts_with(mbsdf::MARK)) {
        return Ok(Format::Mbsdf);
    }
    if let Some(format) = text(head) {
        return Ok(format);
    }
    if named && !bytes.is_empty() && (bytes.len() as u64).is_multiple_of(nbrdf::SIZE) {
        return Ok(Format::NeuralBrdf);
    }
    let beginning = if bytes.is_empty() { "nothing: it is empty".to_owned() } else { printable(bytes) };
    Err(Problem::Unknown { beginning, known: KNOWN })
}

/// By the first line that is neither empty nor a comment.
fn text(head: &[u8]) -> Option<Format> {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    let line = head
        .split(|&b| b == b'\n')
        .filter_map(|l| std::str::from_utf8(l).ok())
        .map(str::trim)
        .find(|l| !l.is_empty() && !l.starts_with('#'))?;
    if line.starts_with('{') {
        let head = String::from_utf8_lossy(head);
        // other JSON exists; ours says so in its first keys or its reader says what it misses
        if head.contains("\"gonio-flake-map\"") {
            return Some(Format::FlakeMap);
        }
        return head.contains("\"model\"").then_some(Format::Model);
    }
    if line.split(',').any(|column| column.trim() == "theta_i_deg") {
        return Some(Format::MeasuredCsv);
    }
    let number = line.split('#').next().unwrap_or_default().trim();
    number.parse::<u32>().is_ok().then_some(Format::Cornell)
}

fn printable(bytes: &[u8]) -> String {
    let shown: String = bytes.iter().take(16).flat_map(|b| b.escape_ascii()).map(char::from).collect();
    format!("\"{shown}\"")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_apart_by_their_first_bytes() {
        let cases: [(&[u8], Format); 10] = [
            (b"gonio-paint\n\x01", Format::CarPaint),
            (b"CDF\x02rest", Format::Netcdf),
            (b"tensor_file\0\x01", Format::Rgl),
            (b"Z\0\0\0Z\0\0\0\xb4\0\0\0rest", Format::Merl),
            (b"NVIDIA ARC MBSDF V1\nMBSDF_DATA_REFLECTION=\n\0", Format::Mbsdf),
            (b"\xef\xbb\xbf# note\ntheta_o_deg, theta_i_deg,phi_deg,r,g,b\n", Format::MeasuredCsv),
            (b"\n {\"coat\": {}, \"model\": \"lambert\"}", Format::Model),
            (b"{\"format\": \"gonio-flake-map\", \"version\": 1", Format::FlakeMap),
            (b"# Cornell\n\n31 # wavelengths\n400", Format::Cornell),
            (&[0; 2700], Format::NeuralBrdf),
        ];
        for (bytes, format) in cases {
            assert_eq!(detect(bytes, true).unwrap(), format);
        }
    }

    #[test]
    fn what_is_not_known_is_told_with_what_is() {
        for bytes in [&b""[..], b"CDF\x03", b"{}", b"\x89PNG\r\n", &[0; 2700], &[0xff; 100]] {
            let text = detect(bytes, false).unwrap_err().to_string();
            assert!(text.contains("MERL") && text.contains("begins with"), "{text}");
        }
        assert!(detect(b"\x89HDF\r\n\x1a\n\0", false).unwrap_err().to_string().contains("nccopy"));
    }
}
