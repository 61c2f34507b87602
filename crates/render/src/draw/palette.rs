//! Colours that survive colour-blindness and grey printing: two colour maps and a categorical set.
//!
//! `viridis` (Smith and van der Walt, public domain) for magnitudes: evenly rising lightness. `vik` (Scientific colour maps,
//! © Fabio Crameri, MIT licence) for signed differences: blue below, brown above, lightest at zero. The categorical colours are those of Okabe
//! and Ito (2008). Tables hold every eighth of the 256 entries, linear in between.

use crate::picture::Srgb;

/// A continuous colour map on 0…1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourMap {
    /// Magnitudes: dark is small.
    Viridis,
    /// Signed values: 0.5 is zero.
    Vik,
}

impl ColourMap {
    /// The colour at `t`, clamped to 0…1; a value that is not a number takes the low end.
    #[must_use]
    pub fn at(self, t: f64) -> Srgb {
        let table = match self {
            Self::Viridis => &VIRIDIS,
            Self::Vik => &VIK,
        };
        let last = table.len() - 1;
        let x = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) } * last as f64;
        let k = (x as usize).min(last - 1);
        let f = x - k as f64;
        let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * f).round() as u8;
        [0, 1, 2].map(|c| mix(table[k][c], table[k + 1][c]))
    }
}

/// Text and axes.
pub const INK: Srgb = [0x22, 0x26, 0x2b];
/// Secondary text.
pub const MUTED: Srgb = [0x5d, 0x66, 0x70];
/// Grid lines and frames of panels.
pub const FAINT: Srgb = [0xdd, 0xe1, 0xe6];
/// Where there is no value: the light and the dark of the hatching.
pub const HATCH: [Srgb; 2] = [[0xf2, 0xf3, 0xf5], [0xa9, 0xaf, 0xb8]];

/// Categorical colours (Okabe–Ito), in an order in which neighbours differ in lightness as well.
pub const CATEGORIES: [Srgb; 7] = [
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0x00, 0x9e, 0x73],
    [0xcc, 0x79, 0xa7],
    [0xe6, 0x9f, 0x00],
    [0x56, 0xb4, 0xe9],
    [0x00, 0x00, 0x00],
];

#[rustfmt::skip]
const VIRIDIS: [Srgb; 33] = [
    [68, 1, 84], [71, 13, 96], [72, 24, 106], [72, 35, 116], [71, 45, 123], [69, 55, 129],
    [66, 64, 134], [62, 73, 137], [59, 82, 139], [55, 91, 141], [51, 99, 141], [47, 107, 142],
    [44, 114, 142], [41, 122, 142], [38, 130, 142], [35, 137, 142], [33, 145, 140], [31, 152, 139],
    [31, 160, 136], [34, 167, 133], [40, 174, 128], [50, 182, 122], [63, 188, 115], [78, 195, 107],
    [94, 201, 98], [112, 207, 87], [132, 212, 75], [152, 216, 62], [173, 220, 48], [194, 223, 35],
    [216, 226, 25], [236, 229, 27], [253, 231, 37],
];

#[rustfmt::skip]
const VIK: [Srgb; 33] = [
    [0, 18, 97], [2, 31, 105], [2, 43, 113], [2, 55, 121], [3, 68, 129], [5, 81, 137],
    [12, 94, 146], [28, 109, 156], [48, 125, 166], [72, 141, 178], [97, 158, 189], [122, 174, 200],
    [148, 190, 210], [173, 205, 221], [198, 219, 230], [222, 230, 233], [236, 229, 224], [238, 217, 205],
    [233, 202, 184], [226, 186, 162], [219, 170, 141], [213, 155, 121], [207, 140, 102], [201, 126, 83],
    [194, 112, 65], [188, 98, 47], [178, 81, 29], [163, 62, 13], [145, 45, 6], [129, 31, 6],
    [115, 20, 6], [101, 9, 7], [89, 0, 8],
];

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_optics::colour;

    fn lightness(c: Srgb) -> f64 {
        let linear = c.map(|v| {
            let x = f64::from(v) / 255.0;
            if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
        });
        colour::lab_from_rgb(linear).l
    }

    #[test]
    fn magnitudes_rise_in_lightness_all_the_way() {
        let l: Vec<f64> = (0..=40).map(|k| lightness(ColourMap::Viridis.at(f64::from(k) / 40.0))).collect();
        assert!(l.windows(2).all(|w| w[1] > w[0]), "{l:?}");
    }

    #[test]
    fn signed_values_are_lightest_at_zero_and_of_opposite_hue_beyond() {
        let l: Vec<f64> = (0..=40).map(|k| lightness(ColourMap::Vik.at(f64::from(k) / 40.0))).collect();
        let top = (0..l.len()).max_by(|&a, &b| l[a].total_cmp(&l[b])).unwrap();
        assert!((19..=21).contains(&top), "{top}");
        let (low, high) = (ColourMap::Vik.at(0.2), ColourMap::Vik.at(0.8));
        assert!(low[2] > low[0] && high[0] > high[2]);
    }

    #[test]
    fn what_is_not_a_number_has_a_colour_too() {
        assert_eq!(ColourMap::Viridis.at(f64::NAN), ColourMap::Viridis.at(-3.0));
        assert_eq!(ColourMap::Viridis.at(f64::INFINITY), [253, 231, 37]);
    }
}
