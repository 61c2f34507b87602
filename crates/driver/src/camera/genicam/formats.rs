//! Pixel formats of GenICam (PFNC 2.1) that carry raw counts in bytes or 16-bit words, and which one of a camera's is taken.

#[cfg(test)]
use gonio_instrument::BayerPattern;

use crate::camera::raw::{Code, RawFormat, Wanted, raw_format};

/// The format of the wanted depth, or else the next deeper one; Bayer of the right pattern before grey.
///
/// Names are `Mono12` or `BayerRG12`; packed ones (`Mono12p`, `Mono12Packed`) are left alone, since every camera has the unpacked one beside it.
///
/// # Errors
/// What is offered instead, in words.
pub fn choose<'a>(names: &'a [String], wanted: &Wanted) -> Result<(&'a str, &'static RawFormat), String> {
    names
        .iter()
        .filter_map(|name| Some((name.as_str(), format(name)?)))
        .filter(|(_, f)| f.bits >= wanted.bits && f.pattern.is_none_or(|p| p == wanted.pattern))
        .min_by_key(|(_, f)| (f.bits, f.pattern.is_none()))
        .ok_or_else(|| {
            format!(
                "no raw format with {} bits ({:?} or grey) is offered; it offers {}; give the --instrument that describes this camera, or another camera",
                wanted.bits,
                wanted.pattern,
                if names.is_empty() { "nothing".to_owned() } else { names.join(", ") }
            )
        })
}

/// The same layout under its Video4Linux code.
fn format(name: &str) -> Option<&'static RawFormat> {
    let (pattern, bits) = match name.strip_prefix("Mono") {
        Some(bits) => (None, bits),
        None => {
            let (pattern, bits) = name.strip_prefix("Bayer")?.split_at_checked(2)?;
            (Some(pattern), bits)
        }
    };
    let code: &[u8; 4] = match (pattern, bits) {
        (None, "8") => b"GREY",
        (None, "10") => b"Y10 ",
        (None, "12") => b"Y12 ",
        (None, "14") => b"Y14 ",
        (None, "16") => b"Y16 ",
        (Some("RG"), "8") => b"RGGB",
        (Some("BG"), "8") => b"BA81",
        (Some("GR"), "8") => b"GRBG",
        (Some("GB"), "8") => b"GBRG",
        (Some("RG"), "10") => b"RG10",
        (Some("BG"), "10") => b"BG10",
        (Some("GR"), "10") => b"BA10",
        (Some("GB"), "10") => b"GB10",
        (Some("RG"), "12") => b"RG12",
        (Some("BG"), "12") => b"BG12",
        (Some("GR"), "12") => b"BA12",
        (Some("GB"), "12") => b"GB12",
        (Some("RG"), "16") => b"RG16",
        (Some("BG"), "16") => b"BYR2",
        (Some("GR"), "16") => b"GR16",
        (Some("GB"), "16") => b"GB16",
        _ => return None,
    };
    raw_format(Code(*code))
}

/// The tile that a name of PFNC means.
#[cfg(test)]
fn tile(name: &str) -> Option<BayerPattern> {
    match name.strip_prefix("Bayer")?.get(..2)? {
        "RG" => Some(BayerPattern::Rggb),
        "BG" => Some(BayerPattern::Bggr),
        "GR" => Some(BayerPattern::Grbg),
        "GB" => Some(BayerPattern::Gbrg),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_means_its_own_depth_and_pattern() {
        for bits in [8, 10, 12, 14, 16] {
            let mono = format(&format!("Mono{bits}")).expect("grey");
            assert_eq!(
                (mono.bits, mono.pattern, mono.row_bytes(4)),
                (bits, None, if bits == 8 { 4 } else { 8 })
            );
        }
        for order in ["RG", "BG", "GR", "GB"] {
            for bits in [8, 10, 12, 16] {
                let name = format!("Bayer{order}{bits}");
                let found = format(&name).expect(&name);
                assert_eq!((found.bits, found.pattern), (bits, tile(&name)), "{name}");
                assert_eq!(found.row_bytes(4), if bits == 8 { 4 } else { 8 });
            }
        }
        for name in
            ["Mono12p", "Mono12Packed", "RGB8", "BayerRG12p", "Bayer", "BayerRG", "Mono", "YCbCr422_8"]
        {
            assert_eq!(format(name), None, "{name}");
        }
    }

    #[test]
    fn the_right_depth_and_pattern_are_taken() {
        let wanted = Wanted { width: 1, height: 1, bits: 12, pattern: BayerPattern::Rggb };
        let chosen = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(ToString::to_string).collect();
            choose(&names, &wanted).map(|(name, _)| name.to_owned())
        };
        assert_eq!(chosen(&["Mono8", "Mono16", "BayerBG12", "BayerRG12", "Mono12"]), Ok("BayerRG12".into()));
        assert_eq!(chosen(&["Mono8", "Mono16", "Mono12p"]), Ok("Mono16".into()));
        let error = chosen(&["Mono8", "BayerBG12"]).expect_err("none");
        assert!(error.contains("Mono8, BayerBG12") && error.contains("12 bits"), "{error}");
    }
}
