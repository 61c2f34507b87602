//! The controls of the camera: exposure, its mode, gain, and the negotiation of the stream.
//!
//! As with many a real camera, exposure is automatic at first and refuses to be set while it is; longer exposures are rounded in silence, so
//! that a host has to read back what it got; gain is not at its least.

use std::time::Duration;

use super::uvc;
use crate::redir::Setup;
use crate::usb::Stalled;

const SET_CUR: u8 = 0x01;
const GET_CUR: u8 = 0x81;
const GET_MIN: u8 = 0x82;
const GET_MAX: u8 = 0x83;
const GET_RES: u8 = 0x84;
const GET_LEN: u8 = 0x85;
const GET_INFO: u8 = 0x86;
const GET_DEF: u8 = 0x87;

const EXPOSURE_MODE: u8 = 2;
const EXPOSURE_TIME: u8 = 4;
const GAIN: u8 = 4;
const ERROR_CODE: u8 = 2;
const PROBE: u8 = 1;
const COMMIT: u8 = 2;
/// Bytes of the stream's negotiation in version 1.1 of the class.
const NEGOTIATION: usize = 34;

/// Exposure mode: set by the host.
const MANUAL: u8 = 1;
/// Exposure mode: the camera chooses time, the aperture is fixed.
const APERTURE_PRIORITY: u8 = 8;
/// What the automatic chooses, 100 µs.
const AUTOMATIC_EXPOSURE: u32 = 250;
/// Longest exposure, 100 µs.
const LONGEST: u32 = 20_000;
/// Above this exposures are multiples of [`COARSE`], 100 µs.
const FINE_UP_TO: u32 = 100;
const COARSE: u32 = 5;
/// Gain in steps of half a decibel.
const LARGEST_GAIN: u16 = 48;
const DEFAULT_GAIN: u16 = 12;

/// Codes of the class for why a request was refused.
mod refusal {
    pub const NONE: u8 = 0;
    pub const WRONG_STATE: u8 = 2;
    pub const OUT_OF_RANGE: u8 = 4;
    pub const INVALID_CONTROL: u8 = 6;
    pub const INVALID_REQUEST: u8 = 7;
}

/// State of all controls.
#[derive(Clone, Debug)]
pub struct Controls {
    sizes: Vec<[u16; 2]>,
    mode: u8,
    exposure: u32,
    gain: u16,
    refusal: u8,
    probe: Stream,
    committed: Option<Stream>,
}

/// A negotiated stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream {
    /// Place in the list of sizes.
    pub frame: usize,
    /// 100 ns.
    pub interval: u32,
}

/// What happened besides the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Nothing to the stream.
    None,
    /// The stream begins.
    Start(Stream),
}

impl Controls {
    /// As after power-on.
    #[must_use]
    pub fn new(sizes: Vec<[u16; 2]>) -> Controls {
        Controls {
            sizes,
            mode: APERTURE_PRIORITY,
            exposure: AUTOMATIC_EXPOSURE,
            gain: DEFAULT_GAIN,
            refusal: refusal::NONE,
            probe: Stream { frame: 0, interval: uvc::INTERVALS[0] },
            committed: None,
        }
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        *self = Controls::new(std::mem::take(&mut self.sizes));
    }

    /// How long a frame is exposed.
    #[must_use]
    pub fn exposure(&self) -> Duration {
        let units = if self.mode == MANUAL { self.exposure } else { AUTOMATIC_EXPOSURE };
        Duration::from_micros(u64::from(units) * 100)
    }

    /// Factor on what the converter gives.
    #[must_use]
    pub fn gain_factor(&self) -> f64 {
        10f64.powf(f64::from(self.gain) / 40.0)
    }

    /// Answers a class request.
    ///
    /// # Errors
    /// [`Stalled`] for what is unknown or not allowed now; the reason can be asked for.
    pub fn request(&mut self, setup: Setup, data: &[u8]) -> Result<(Vec<u8>, Effect), Stalled> {
        let selector = (setup.value >> 8) as u8;
        let [interface, entity] = setup.index.to_le_bytes();
        let answer = match (interface, entity, selector) {
            (uvc::CONTROL_INTERFACE, 0, ERROR_CODE) => match setup.request {
                GET_CUR => return Ok((vec![self.refusal], Effect::None)),
                GET_INFO => return Ok((vec![1], Effect::None)),
                _ => Err(refusal::INVALID_REQUEST),
            },
            (uvc::CONTROL_INTERFACE, uvc::CAMERA_TERMINAL, EXPOSURE_MODE) => self.mode(setup.request, data),
            (uvc::CONTROL_INTERFACE, uvc::CAMERA_TERMINAL, EXPOSURE_TIME) => {
                self.exposure_time(setup.request, data)
            }
            (uvc::CONTROL_INTERFACE, uvc::PROCESSING_UNIT, GAIN) => self.gain(setup.request, data),
            (uvc::STREAM_INTERFACE, 0, PROBE | COMMIT) => {
                return self.negotiate(selector == COMMIT, setup.request, data);
            }
            _ => Err(refusal::INVALID_CONTROL),
        };
        match answer {
            Ok(bytes) => {
                self.refusal = refusal::NONE;
                Ok((bytes, Effect::None))
            }
            Err(code) => {
                self.refusal = code;
                Err(Stalled)
            }
        }
    }

    fn mode(&mut self, request: u8, data: &[u8]) -> Result<Vec<u8>, u8> {
        Ok(match request {
            SET_CUR => match data {
                [mode @ (MANUAL | APERTURE_PRIORITY)] => {
                    self.mode = *mode;
                    vec![]
                }
                _ => return Err(refusal::OUT_OF_RANGE),
            },
            GET_CUR => vec![self.mode],
            // which modes there are
            GET_RES => vec![MANUAL | APERTURE_PRIORITY],
            GET_DEF => vec![APERTURE_PRIORITY],
            GET_INFO => vec![3],
            GET_LEN => vec![1, 0],
            _ => return Err(refusal::INVALID_REQUEST),
        })
    }

    fn exposure_time(&mut self, request: u8, data: &[u8]) -> Result<Vec<u8>, u8> {
        let automatic = self.mode != MANUAL;
        Ok(match request {
            SET_CUR if automatic => return Err(refusal::WRONG_STATE),
            SET_CUR => {
                let asked = <[u8; 4]>::try_from(data).map(u32::from_le_bytes);
                let asked = asked.map_err(|_| refusal::OUT_OF_RANGE)?;
                if !(1..=LONGEST).contains(&asked) {
                    return Err(refusal::OUT_OF_RANGE);
                }
                let coarse = asked.saturating_add(COARSE / 2) / COARSE * COARSE;
                self.exposure = if asked > FINE_UP_TO { coarse.min(LONGEST) } else { asked };
                vec![]
            }
            GET_CUR if automatic => AUTOMATIC_EXPOSURE.to_le_bytes().to_vec(),
            GET_CUR => self.exposure.to_le_bytes().to_vec(),
            GET_MIN | GET_RES => 1u32.to_le_bytes().to_vec(),
            GET_MAX => LONGEST.to_le_bytes().to_vec(),
            GET_DEF => AUTOMATIC_EXPOSURE.to_le_bytes().to_vec(),
            // bit 3: it changes by itself. Without it uvcvideo would tell what was asked for instead of what was taken
            GET_INFO => vec![0b1011 | u8::from(automatic) << 2],
            GET_LEN => vec![4, 0],
            _ => return Err(refusal::INVALID_REQUEST),
        })
    }

    fn gain(&mut self, request: u8, data: &[u8]) -> Result<Vec<u8>, u8> {
        Ok(match request {
            SET_CUR => {
                let asked = <[u8; 2]>::try_from(data).map(u16::from_le_bytes);
                self.gain = asked.ok().filter(|g| *g <= LARGEST_GAIN).ok_or(refusal::OUT_OF_RANGE)?;
                vec![]
            }
            GET_CUR => self.gain.to_le_bytes().to_vec(),
            GET_MIN => vec![0, 0],
            GET_MAX => LARGEST_GAIN.to_le_bytes().to_vec(),
            GET_RES => vec![1, 0],
            GET_DEF => DEFAULT_GAIN.to_le_bytes().to_vec(),
            GET_INFO => vec![3],
            GET_LEN => vec![2, 0],
            _ => return Err(refusal::INVALID_REQUEST),
        })
    }

    fn negotiate(&mut self, commit: bool, request: u8, data: &[u8]) -> Result<(Vec<u8>, Effect), Stalled> {
        match request {
            SET_CUR => {
                let stream = self.proposed(data).ok_or(Stalled)?;
                self.probe = stream;
                if commit {
                    self.committed = Some(stream);
                    return Ok((vec![], Effect::Start(stream)));
                }
                Ok((vec![], Effect::None))
            }
            GET_CUR | GET_MIN | GET_MAX | GET_DEF => {
                let stream = if commit { self.committed.unwrap_or(self.probe) } else { self.probe };
                Ok((self.negotiation(stream), Effect::None))
            }
            GET_INFO => Ok((vec![3], Effect::None)),
            GET_LEN => Ok((vec![NEGOTIATION as u8, 0], Effect::None)),
            _ => Err(Stalled),
        }
    }

    /// The stream next to what the host proposes.
    fn proposed(&self, data: &[u8]) -> Option<Stream> {
        let frame = usize::from(*data.get(3)?).clamp(1, self.sizes.len()) - 1;
        let asked = u32::from_le_bytes(data.get(4..8)?.try_into().ok()?);
        let interval = uvc::INTERVALS.into_iter().min_by_key(|i| i.abs_diff(asked))?;
        Some(Stream { frame, interval })
    }

    fn negotiation(&self, stream: Stream) -> Vec<u8> {
        let mut bytes = vec![1, 0, 1, stream.frame as u8 + 1];
        bytes.extend(stream.interval.to_le_bytes());
        bytes.extend([0; 10]);
        let size = self.sizes.get(stream.frame).copied().unwrap_or_default();
        for number in [uvc::frame_bytes(size), uvc::PAYLOAD, uvc::CLOCK_HZ] {
            bytes.extend(number.to_le_bytes());
        }
        // frames are told apart by a bit in the payload's header, their end by another
        bytes.extend([3, 0, 0, 0]);
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(c: &mut Controls, request: u8, value: u16, index: u16, data: &[u8]) -> Option<Vec<u8>> {
        let setup = Setup { request_type: 0, request, value, index, length: 64 };
        c.request(setup, data).ok().map(|(bytes, _)| bytes)
    }

    #[test]
    fn exposure_is_refused_while_automatic_and_rounded_in_silence_when_long() {
        let mut c = Controls::new(vec![[160, 128]]);
        let (time, mode) = (0x0400, 0x0200);
        assert_eq!(ask(&mut c, SET_CUR, time, 0x0100, &50u32.to_le_bytes()), None);
        assert_eq!(ask(&mut c, GET_CUR, 0x0200, 0, &[]), Some(vec![refusal::WRONG_STATE]));
        assert_eq!(ask(&mut c, SET_CUR, mode, 0x0100, &[MANUAL]), Some(vec![]));
        for (asked, taken) in [(1, 1), (99, 99), (101, 100), (103, 105), (19_999, 20_000)] {
            assert!(ask(&mut c, SET_CUR, time, 0x0100, &u32::to_le_bytes(asked)).is_some());
            assert_eq!(c.exposure(), Duration::from_micros(100 * taken));
        }
        assert_eq!(ask(&mut c, SET_CUR, time, 0x0100, &20_001u32.to_le_bytes()), None);
    }

    #[test]
    fn a_negotiation_has_the_length_of_the_class_and_settles_on_what_there_is() {
        let mut c = Controls::new(vec![[160, 128], [640, 512]]);
        let mut wish = ask(&mut c, GET_DEF, 0x0100, 1, &[]).expect("a default");
        assert_eq!(wish.len(), NEGOTIATION);
        wish[3] = 9;
        wish[4..8].copy_from_slice(&900_000u32.to_le_bytes());
        assert!(ask(&mut c, SET_CUR, 0x0100, 1, &wish).is_some());
        let got = ask(&mut c, GET_CUR, 0x0100, 1, &[]).expect("the state");
        assert_eq!(got[3], 2);
        assert_eq!(got[4..8], 1_000_000u32.to_le_bytes());
        assert_eq!(got[18..22], (640u32 * 512 * 2).to_le_bytes());
    }
}
