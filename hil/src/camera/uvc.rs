//! What a camera of the USB video class, version 1.1, says of itself: one stream over a bulk endpoint, 16-bit grey.

use crate::usb::Descriptors;

/// Product number.
pub const PRODUCT: u16 = 0x0002;
/// Serial number.
pub const SERIAL: &str = "GONIO-CAM-1";
/// Endpoint of the stream.
pub const STREAM: u8 = 0x81;
/// Interface of the controls.
pub const CONTROL_INTERFACE: u8 = 0;
/// Interface of the stream.
pub const STREAM_INTERFACE: u8 = 1;
/// Entity of exposure and its mode.
pub const CAMERA_TERMINAL: u8 = 1;
/// Entity of the gain.
pub const PROCESSING_UNIT: u8 = 2;
const OUTPUT_TERMINAL: u8 = 3;
/// Ticks of the camera's clock per second.
pub const CLOCK_HZ: u32 = 1_000_000;
/// Frame intervals, 100 ns; the first is the default.
pub const INTERVALS: [u32; 3] = [333_333, 1_000_000, 2_000_000];
/// Bytes of a payload at most: as many packets as the guest's driver puts into one transfer, so that each transfer is one payload.
pub const PAYLOAD: u32 = 32 * 512;

const VERSION: [u8; 2] = [0x10, 0x01];
const SPECIFIC: u8 = 0x24;
const ASSOCIATION: u8 = 0x0b;
const VIDEO: u8 = 0x0e;
/// "Y16 ": 16-bit grey, little endian.
const Y16: [u8; 16] = [b'Y', b'1', b'6', b' ', 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71];

/// The descriptors of a camera with these frame sizes (columns, rows), the first one the default.
#[must_use]
pub fn descriptors(sizes: &[[u16; 2]]) -> Descriptors {
    Descriptors::new([0xef, 2, 1], PRODUCT, ["gonio", "gonio virtual camera", SERIAL])
        .with(&[8, ASSOCIATION, CONTROL_INTERFACE, 2, VIDEO, 3, 0, 0])
        .interface(CONTROL_INTERFACE, [VIDEO, 1, 0], &entities(), &[])
        .interface(STREAM_INTERFACE, [VIDEO, 2, 0], &formats(sizes), &[STREAM])
}

/// Camera terminal → processing unit → output terminal.
fn entities() -> Vec<u8> {
    // controls of the terminal: bit 1 exposure mode, bit 3 exposure time
    let terminal = [18, SPECIFIC, 2, CAMERA_TERMINAL, 0x01, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0x0a, 0, 0];
    // controls of the unit: bit 9 gain
    let unit = [12, SPECIFIC, 5, PROCESSING_UNIT, CAMERA_TERMINAL, 0, 0, 2, 0, 0x02, 0, 0];
    let output = [9, SPECIFIC, 3, OUTPUT_TERMINAL, 0x01, 0x01, 0, PROCESSING_UNIT, 0];
    let mut header = vec![13, SPECIFIC, 1];
    header.extend(VERSION);
    let total = 13 + terminal.len() + unit.len() + output.len();
    header.extend((total as u16).to_le_bytes());
    header.extend(CLOCK_HZ.to_le_bytes());
    header.extend([1, STREAM_INTERFACE]);
    [&header[..], &terminal, &unit, &output].concat()
}

fn formats(sizes: &[[u16; 2]]) -> Vec<u8> {
    let mut format = vec![27, SPECIFIC, 4, 1, sizes.len() as u8];
    format.extend(Y16);
    format.extend([16, 1, 0, 0, 0, 0]);
    let frames: Vec<u8> = sizes.iter().enumerate().flat_map(|(i, s)| frame(i as u8 + 1, *s)).collect();
    let colour = [6, SPECIFIC, 0x0d, 1, 1, 4];
    let mut header = vec![14, SPECIFIC, 1, 1];
    let total = 14 + format.len() + frames.len() + colour.len();
    header.extend((total as u16).to_le_bytes());
    header.extend([STREAM, 0, OUTPUT_TERMINAL, 0, 0, 0, 1, 0]);
    [&header[..], &format, &frames, &colour].concat()
}

fn frame(index: u8, [width, height]: [u16; 2]) -> Vec<u8> {
    let bytes = frame_bytes([width, height]);
    let bits_per_second = |interval: u32| (u64::from(bytes) * 80_000_000 / u64::from(interval)) as u32;
    let mut d = vec![26 + 4 * INTERVALS.len() as u8, SPECIFIC, 5, index, 0];
    d.extend(width.to_le_bytes());
    d.extend(height.to_le_bytes());
    for number in
        [bits_per_second(INTERVALS[INTERVALS.len() - 1]), bits_per_second(INTERVALS[0]), bytes, INTERVALS[0]]
    {
        d.extend(number.to_le_bytes());
    }
    d.push(INTERVALS.len() as u8);
    d.extend(INTERVALS.iter().flat_map(|i| i.to_le_bytes()));
    d
}

/// Bytes of a frame.
#[must_use]
pub fn frame_bytes([width, height]: [u16; 2]) -> u32 {
    u32::from(width) * u32::from(height) * 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_totals_of_the_headers_are_the_bytes_that_follow() {
        let d = descriptors(&[[160, 128], [640, 512]]);
        let c = &d.configuration;
        let mut at = 0;
        let (mut total, mut sum) = (0, 0);
        while at < c.len() {
            let (length, kind) = (usize::from(c[at]), c[at + 1]);
            assert!(length > 0 && at + length <= c.len());
            if kind == SPECIFIC && c[at + 2] == 1 {
                // header of the controls has its total at 5, that of the stream at 4
                let place = if total == 0 { 5 } else { 4 };
                assert_eq!(total, sum, "total of the header before");
                total = usize::from(u16::from_le_bytes([c[at + place], c[at + place + 1]]));
                sum = 0;
            }
            if kind == SPECIFIC {
                sum += length;
            }
            at += length;
        }
        assert_eq!((at, total), (c.len(), sum));
        assert_eq!(d.endpoints.len(), 1);
    }
}
