//! Pixel formats that carry raw counts: which one of a camera's is taken, and how its bytes become counts.
//!
//! Taken are 8- to 16-bit grey and Bayer formats, as bytes, as little-endian words, or packed as MIPI packs them (four 10-bit values in five bytes, two 12-bit
//! values in three, low bits last). Nothing that has been through a colour conversion or a compression is raw.

use gonio_instrument::BayerPattern;
use std::fmt;

/// A four-character code, as the kernel writes it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Code(pub [u8; 4]);

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Codes of drivers may hold anything, and often end in blanks.
        let text: String =
            self.0.iter().flat_map(|b| std::ascii::escape_default(*b)).map(char::from).collect();
        f.write_str(text.trim_end())
    }
}

impl fmt::Debug for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Code({self})")
    }
}

/// How values lie in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    Byte,
    /// 16 bits, low byte first, value in the low bits.
    Word,
    /// Five bytes for four values: four times the upper eight bits, then the lower two of each, first value lowest.
    Packed10,
    /// Three bytes for two values: twice the upper eight bits, then the lower four of each, first value lowest.
    Packed12,
}

/// A format that carries raw counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawFormat {
    /// Its code.
    pub code: Code,
    layout: Layout,
    /// Bits of a value; for 16 the sensor behind it may have fewer.
    pub bits: u32,
    /// Colour filter pattern, where the format tells it; grey formats carry whatever the sensor gives.
    pub pattern: Option<BayerPattern>,
}

impl RawFormat {
    /// Bits of a value if the format tells them: 16-bit formats are containers for sensors of any depth.
    #[must_use]
    pub fn told_bits(&self) -> Option<u32> {
        Some(self.bits).filter(|bits| *bits < 16)
    }

    /// Bytes of a row of `width` values without padding.
    #[must_use]
    pub fn row_bytes(&self, width: u32) -> usize {
        let width = width as usize;
        match self.layout {
            Layout::Byte => width,
            Layout::Word => 2 * width,
            Layout::Packed10 => (5 * width).div_ceil(4),
            Layout::Packed12 => (3 * width).div_ceil(2),
        }
    }

    /// Counts of a frame, row by row. Rows begin every `stride` bytes (0: without padding); the last may lack its padding.
    ///
    /// # Errors
    /// [`TooShort`] for a buffer that does not hold all rows.
    pub fn unpack(&self, data: &[u8], width: u32, height: u32, stride: u32) -> Result<Vec<u16>, TooShort> {
        let row = self.row_bytes(width);
        let stride = (stride as usize).max(row);
        let needed = stride * (height as usize).saturating_sub(1) + row;
        if data.len() < needed || width == 0 || height == 0 {
            return Err(TooShort { found: data.len(), needed });
        }
        let mut counts = Vec::with_capacity(width as usize * height as usize);
        for line in data.chunks(stride).take(height as usize) {
            let line = line.get(..row).unwrap_or(line);
            let end = counts.len() + width as usize;
            match self.layout {
                Layout::Byte => counts.extend(line.iter().map(|b| u16::from(*b))),
                Layout::Word => {
                    let words = line.chunks_exact(2).map(|w| u16::from(w[0]) | u16::from(w[1]) << 8);
                    counts.extend(words);
                }
                Layout::Packed10 => unpack_groups(line, 4, 2, &mut counts),
                Layout::Packed12 => unpack_groups(line, 2, 4, &mut counts),
            }
            counts.truncate(end);
        }
        Ok(counts)
    }
}

/// Groups of `n` values: their upper eight bits, then one byte with `low` lower bits of each. The last group of a row may be cut.
fn unpack_groups(line: &[u8], n: usize, low: u32, counts: &mut Vec<u16>) {
    for group in line.chunks(n + 1) {
        let (upper, lower) = group.split_at(group.len() - 1);
        let lower = u16::from(lower[0]);
        let values = upper
            .iter()
            .zip(0..)
            .map(|(high, place)| u16::from(*high) << low | (lower >> (low * place)) & ((1 << low) - 1));
        counts.extend(values);
    }
}

/// A buffer that does not hold the whole frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("it holds {found} bytes, a whole frame takes {needed}")]
pub struct TooShort {
    /// Bytes found.
    pub found: usize,
    /// Bytes of a whole frame.
    pub needed: usize,
}

const fn grey(code: &[u8; 4], layout: Layout, bits: u32) -> RawFormat {
    RawFormat { code: Code(*code), layout, bits, pattern: None }
}

const fn bayer(code: &[u8; 4], layout: Layout, bits: u32, pattern: BayerPattern) -> RawFormat {
    RawFormat { code: Code(*code), layout, bits, pattern: Some(pattern) }
}

/// Every format that is understood (linux/videodev2.h).
pub const RAW_FORMATS: &[RawFormat] = {
    use BayerPattern::{Bggr, Gbrg, Grbg, Rggb};
    use Layout::{Byte, Packed10, Packed12, Word};
    &[
        grey(b"GREY", Byte, 8),
        grey(b"Y10 ", Word, 10),
        grey(b"Y12 ", Word, 12),
        grey(b"Y14 ", Word, 14),
        grey(b"Y16 ", Word, 16),
        grey(b"Y10P", Packed10, 10),
        grey(b"Y12P", Packed12, 12),
        bayer(b"BA81", Byte, 8, Bggr),
        bayer(b"GBRG", Byte, 8, Gbrg),
        bayer(b"GRBG", Byte, 8, Grbg),
        bayer(b"RGGB", Byte, 8, Rggb),
        bayer(b"BG10", Word, 10, Bggr),
        bayer(b"GB10", Word, 10, Gbrg),
        bayer(b"BA10", Word, 10, Grbg),
        bayer(b"RG10", Word, 10, Rggb),
        bayer(b"pBAA", Packed10, 10, Bggr),
        bayer(b"pGAA", Packed10, 10, Gbrg),
        bayer(b"pgAA", Packed10, 10, Grbg),
        bayer(b"pRAA", Packed10, 10, Rggb),
        bayer(b"BG12", Word, 12, Bggr),
        bayer(b"GB12", Word, 12, Gbrg),
        bayer(b"BA12", Word, 12, Grbg),
        bayer(b"RG12", Word, 12, Rggb),
        bayer(b"pBCC", Packed12, 12, Bggr),
        bayer(b"pGCC", Packed12, 12, Gbrg),
        bayer(b"pgCC", Packed12, 12, Grbg),
        bayer(b"pRCC", Packed12, 12, Rggb),
        bayer(b"BG14", Word, 14, Bggr),
        bayer(b"GB14", Word, 14, Gbrg),
        bayer(b"GR14", Word, 14, Grbg),
        bayer(b"RG14", Word, 14, Rggb),
        bayer(b"BYR2", Word, 16, Bggr),
        bayer(b"GB16", Word, 16, Gbrg),
        bayer(b"GR16", Word, 16, Grbg),
        bayer(b"RG16", Word, 16, Rggb),
    ]
};

/// The raw format with this code.
#[must_use]
pub fn raw_format(code: Code) -> Option<&'static RawFormat> {
    RAW_FORMATS.iter().find(|f| f.code == code)
}

/// Sizes in which a camera gives a format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sizes {
    /// One width and height.
    One(u32, u32),
    /// From the first to the last in steps.
    Steps {
        /// Smallest, largest, step of the width.
        width: [u32; 3],
        /// Smallest, largest, step of the height.
        height: [u32; 3],
    },
}

impl Sizes {
    /// The largest width and height.
    #[must_use]
    pub fn largest(&self) -> [u32; 2] {
        let last = |[low, high, step]: [u32; 3]| low + high.saturating_sub(low) / step.max(1) * step.max(1);
        match *self {
            Sizes::One(width, height) => [width, height],
            Sizes::Steps { width, height } => [last(width), last(height)],
        }
    }

    fn contain(&self, wanted: [u32; 2]) -> bool {
        let on_step = |n: u32, [low, high, step]: [u32; 3]| {
            (low..=high).contains(&n) && (n - low).is_multiple_of(step.max(1))
        };
        match *self {
            Sizes::One(width, height) => [width, height] == wanted,
            Sizes::Steps { width, height } => on_step(wanted[0], width) && on_step(wanted[1], height),
        }
    }
}

impl fmt::Display for Sizes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Sizes::One(width, height) => write!(f, "{width}x{height}"),
            Sizes::Steps { width, height } => {
                write!(f, "{}x{} to {}x{}", width[0], height[0], width[1], height[1])
            }
        }
    }
}

/// A format that a camera offers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Offer {
    /// Its code.
    pub code: Code,
    /// In which sizes.
    pub sizes: Vec<Sizes>,
}

/// What the instrument expects of its camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Bits of a raw value.
    pub bits: u32,
    /// Colour filter pattern.
    pub pattern: BayerPattern,
}

/// No format of the camera fits the instrument.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "no raw format of {width}x{height} pixels with {bits} bits ({pattern:?} or grey) is offered; it offers {offers}; \
     give the --instrument that describes this camera, or another camera"
)]
pub struct NoFormat {
    width: u32,
    height: u32,
    bits: u32,
    pattern: BayerPattern,
    offers: String,
}

/// Chooses the format of the wanted size whose depth is the wanted one, or else the next deeper one; Bayer of the right pattern before grey,
/// words before packed values.
///
/// # Errors
/// [`NoFormat`] with all that is offered.
pub fn choose(offers: &[Offer], wanted: &Wanted) -> Result<&'static RawFormat, NoFormat> {
    offers
        .iter()
        .filter(|o| o.sizes.iter().any(|s| s.contain([wanted.width, wanted.height])))
        .filter_map(|o| raw_format(o.code))
        .filter(|f| f.bits >= wanted.bits && f.pattern.is_none_or(|p| p == wanted.pattern))
        .min_by_key(|f| {
            (f.bits, f.pattern.is_none(), matches!(f.layout, Layout::Packed10 | Layout::Packed12))
        })
        .ok_or_else(|| NoFormat {
            width: wanted.width,
            height: wanted.height,
            bits: wanted.bits,
            pattern: wanted.pattern,
            offers: describe(offers),
        })
}

fn describe(offers: &[Offer]) -> String {
    if offers.is_empty() {
        return "nothing".to_owned();
    }
    let one = |o: &Offer| {
        let sizes: Vec<String> = o.sizes.iter().map(Sizes::to_string).collect();
        format!("{} {}", o.code, sizes.join("/"))
    };
    offers.iter().map(one).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: Wanted = Wanted { width: 160, height: 128, bits: 12, pattern: BayerPattern::Rggb };

    fn offer(code: &[u8; 4]) -> Offer {
        Offer { code: Code(*code), sizes: vec![Sizes::One(640, 480), Sizes::One(160, 128)] }
    }

    fn chosen(codes: &[&[u8; 4]]) -> Result<Code, NoFormat> {
        let offers: Vec<Offer> = codes.iter().map(|c| offer(c)).collect();
        choose(&offers, &WANTED).map(|f| f.code)
    }

    fn format(code: &[u8; 4]) -> &'static RawFormat {
        raw_format(Code(*code)).expect("a known format")
    }

    #[test]
    fn the_right_depth_is_taken_before_a_deeper_one_and_never_a_shallower() {
        assert_eq!(chosen(&[b"YUYV", b"Y16 ", b"Y12 ", b"Y14 "]), Ok(Code(*b"Y12 ")));
        assert_eq!(chosen(&[b"MJPG", b"Y16 ", b"Y10 "]), Ok(Code(*b"Y16 ")));
        assert_eq!(chosen(&[b"Y12 ", b"pRCC", b"RG12"]), Ok(Code(*b"RG12")), "the pattern is told");
        let error = chosen(&[b"YUYV", b"Y10 ", b"BG12"]).expect_err("too shallow, wrong pattern").to_string();
        assert!(
            error.contains("160x128") && error.contains("BG12") && error.contains("Y10 640x480"),
            "{error}"
        );
        assert!(choose(&[], &WANTED).expect_err("nothing").to_string().contains("offers nothing"));
    }

    #[test]
    fn a_size_must_be_offered_exactly() {
        let steps = |step| Sizes::Steps { width: [32, 1280, step], height: [32, 1024, 32] };
        let with = |sizes| choose(&[Offer { code: Code(*b"Y16 "), sizes: vec![sizes] }], &WANTED).is_ok();
        assert!(with(steps(16)) && with(steps(0)) && !with(steps(48)));
        assert!(
            !with(Sizes::One(128, 160)) && !with(Sizes::Steps { width: [200, 300, 1], height: [1, 300, 1] })
        );
    }

    #[test]
    fn every_format_gives_back_the_values_put_in() {
        for f in RAW_FORMATS {
            let (width, height, pad) = (6u32, 3u32, 5usize);
            let top = (1u32 << f.bits) - 1;
            let values: Vec<u16> = (0..width * height).map(|n| (n * 7919 % (top + 1)) as u16).collect();
            let mut data = Vec::new();
            for row in values.chunks(width as usize) {
                data.extend(pack(f, row));
                data.extend(vec![0xEE; pad]);
            }
            let stride = (f.row_bytes(width) + pad) as u32;
            assert_eq!(f.unpack(&data, width, height, stride).as_ref(), Ok(&values), "{f:?}");
            let cut = data.len() - pad;
            assert_eq!(f.unpack(&data[..cut], width, height, stride).as_ref(), Ok(&values), "last padding");
            let short = f.unpack(&data[..cut - 1], width, height, stride);
            assert_eq!(short, Err(TooShort { found: cut - 1, needed: cut }));
        }
    }

    /// Written from the tables of linux's pixel format documentation, not from the code above.
    fn pack(f: &RawFormat, row: &[u16]) -> Vec<u8> {
        match (f.layout, f.bits) {
            (Layout::Byte, _) => row.iter().map(|v| *v as u8).collect(),
            (Layout::Word, _) => row.iter().flat_map(|v| v.to_le_bytes()).collect(),
            (Layout::Packed10, _) => {
                let mut bytes = Vec::new();
                for group in row.chunks(4) {
                    let mut low = 0;
                    for (place, v) in group.iter().enumerate() {
                        bytes.push((v / 4) as u8);
                        low += (v % 4) << (2 * place);
                    }
                    bytes.push(low as u8);
                }
                bytes
            }
            (Layout::Packed12, _) => row
                .chunks(2)
                .flat_map(|p| [(p[0] / 16) as u8, (p[1] / 16) as u8, (p[0] % 16 + p[1] % 16 * 16) as u8])
                .collect(),
        }
    }

    #[test]
    fn known_bytes_give_known_counts() {
        assert_eq!(format(b"Y16 ").unpack(&[0x34, 0x12, 0xff, 0x00], 2, 1, 0), Ok(vec![0x1234, 0xff]));
        assert_eq!(
            format(b"pRAA").unpack(&[0xFF, 0x00, 0x80, 0x01, 0b11_10_01_00], 4, 1, 0),
            Ok(vec![0x3FC, 0x001, 0x202, 0x007])
        );
        assert_eq!(format(b"pBCC").unpack(&[0xAB, 0xDE, 0xFC], 2, 1, 0), Ok(vec![0xABC, 0xDEF]));
        assert_eq!(format(b"BA81").unpack(&[7, 9], 2, 1, 0), Ok(vec![7, 9]));
        assert!(format(b"GREY").unpack(&[], 0, 4, 0).is_err(), "a frame without pixels");
    }

    #[test]
    fn only_formats_below_sixteen_bits_tell_their_depth() {
        assert_eq!(format(b"Y12 ").told_bits(), Some(12));
        assert_eq!(format(b"Y16 ").told_bits(), None);
        assert_eq!(Code([0x59, 0xff, 0, 0x20]).to_string(), "Y\\xff\\x00");
    }
}
