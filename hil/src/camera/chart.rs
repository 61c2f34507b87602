//! A test chart: frames that tell their number, each pixel known to whoever knows the number.

/// Pixels that hold the number, least bits first.
const NUMBER: usize = 5;
/// Bits of a pixel that are used: no more than the tiny instrument's camera has.
const BITS: usize = 12;

/// The pixels of frame `number`.
#[must_use]
pub fn draw(number: u64, pixels: usize) -> Vec<u16> {
    (0..pixels).map(|place| pixel(number, place)).collect()
}

/// The number of a frame, if every pixel is that frame's.
#[must_use]
pub fn read(pixels: &[u16]) -> Option<u64> {
    let number = pixels.get(..NUMBER)?.iter().rev().fold(0, |n, p| n << BITS | u64::from(*p));
    let whole = pixels.iter().enumerate().all(|(place, p)| *p == pixel(number, place));
    whole.then_some(number)
}

fn pixel(number: u64, place: usize) -> u16 {
    if place < NUMBER {
        return (number >> (BITS * place)) as u16 & ((1 << BITS) - 1);
    }
    // Weyl steps, mixed by a multiplication: differs from frame to frame at every place
    let here = (place as u64).wrapping_mul(0xd1b5_4a32_d192_ed03);
    let x = number.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(here);
    ((x ^ x >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> (64 - BITS)) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_tells_its_number_and_a_spoilt_one_does_not() {
        let mut frame = draw(70_001, 160 * 128);
        assert_eq!(read(&frame), Some(70_001));
        let other = draw(70_002, 160 * 128);
        frame[10_000..].copy_from_slice(&other[10_000..]);
        assert_eq!(read(&frame), None, "torn");
        assert_eq!(read(&[1, 2]), None);
    }
}
