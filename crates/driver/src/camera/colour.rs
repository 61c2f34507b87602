//! Colour pictures of webcams, for people to look at: finding the cameras, and one frame as RGB.
//!
//! `nokhwa` finds cameras and delivers their frames as they come; decoding is done here. These pictures have been through the camera's own processing and are no
//! measurement: for those see [`super::v4l`].

use super::guard::guarded;
use nokhwa::Camera;
use nokhwa::utils::{ApiBackend, CameraIndex, FrameFormat, RequestedFormat, RequestedFormatType};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread::Builder;
use std::time::Duration;

/// Frames that pass before one is taken: automatic exposure and white balance find their places in them.
const SETTLE: usize = 8;
/// Formats that can be decoded, the ones of more information first.
const FORMATS: &[FrameFormat] =
    &[FrameFormat::RAWRGB, FrameFormat::RAWBGR, FrameFormat::YUYV, FrameFormat::NV12, FrameFormat::MJPEG];

/// A picture: three bytes a pixel, red first, row by row, as the camera encodes them (about sRGB).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColourPicture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `3 * width * height` bytes.
    pub rgb: Vec<u8>,
    /// Format it came in.
    pub format: String,
}

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ColourError {
    /// The library or the camera says no.
    #[error("camera {index} gives no colour picture: {reason}")]
    Camera {
        /// Number of the camera.
        index: u32,
        /// The library's words.
        reason: String,
    },
    /// No frame in time.
    #[error("camera {index} gave no frame within {waited:?}; plug it in anew")]
    Silent {
        /// Number of the camera.
        index: u32,
        /// How long was waited.
        waited: Duration,
    },
    /// A frame that cannot be decoded.
    #[error("a {format} frame of {found} bytes cannot be {width} x {height} pixels: {reason}")]
    Frame {
        /// Its format.
        format: String,
        /// Its bytes.
        found: usize,
        /// Columns expected.
        width: u32,
        /// Rows expected.
        height: u32,
        /// What is wrong with it.
        reason: String,
    },
}

/// The cameras of this machine: number and name, metadata nodes among them.
#[must_use]
pub fn discover() -> Vec<(u32, String)> {
    // a file `/dev/video…` without a number makes the library panic
    let found =
        guarded(|| nokhwa::query(ApiBackend::Video4Linux)).ok().and_then(Result::ok).unwrap_or_default();
    let mut cameras: Vec<(u32, String)> =
        found.iter().filter_map(|c| Some((c.index().as_index().ok()?, c.human_name()))).collect();
    cameras.sort();
    cameras
}

/// Takes one colour picture, the largest that the camera gives, after automatic exposure has settled.
///
/// # Errors
/// [`ColourError`]. After [`ColourError::Silent`] a thread is left behind that waits for the camera.
pub fn take(index: u32, patience: Duration) -> Result<ColourPicture, ColourError> {
    let failed = move |reason: String| ColourError::Camera { index, reason };
    let (sender, receiver) = sync_channel(1);
    // the library waits for a frame without end
    Builder::new()
        .name("gonio-preview".into())
        .spawn(move || {
            let taken = guarded(|| raw_frame(index)).unwrap_or_else(|words| Err(failed(words)));
            let _ = sender.try_send(taken);
        })
        .map_err(|e| failed(e.to_string()))?;
    match receiver.recv_timeout(patience) {
        Ok(frame) => {
            let (format, width, height, data) = frame?;
            let rgb = decode(format, &data, width, height)?;
            Ok(ColourPicture { width, height, rgb, format: format!("{format:?}") })
        }
        Err(RecvTimeoutError::Timeout) => Err(ColourError::Silent { index, waited: patience }),
        Err(RecvTimeoutError::Disconnected) => Err(failed("its thread has ended".to_owned())),
    }
}

type RawFrame = (FrameFormat, u32, u32, Vec<u8>);

fn raw_frame(index: u32) -> Result<RawFrame, ColourError> {
    let failed = |e: nokhwa::NokhwaError| ColourError::Camera { index, reason: e.to_string() };
    let wanted = RequestedFormat::with_formats(RequestedFormatType::AbsoluteHighestResolution, FORMATS);
    let mut camera =
        Camera::with_backend(CameraIndex::Index(index), wanted, ApiBackend::Video4Linux).map_err(failed)?;
    camera.open_stream().map_err(failed)?;
    for _ in 0..SETTLE {
        camera.frame().map_err(failed)?;
    }
    let frame = camera.frame().map_err(failed)?;
    let size = frame.resolution();
    Ok((frame.source_frame_format(), size.width(), size.height(), frame.buffer().to_vec()))
}

/// Bytes of a frame as RGB.
fn decode(format: FrameFormat, data: &[u8], width: u32, height: u32) -> Result<Vec<u8>, ColourError> {
    let wrong = |reason: &str| ColourError::Frame {
        format: format!("{format:?}"),
        found: data.len(),
        width,
        height,
        reason: reason.to_owned(),
    };
    let pixels = width as usize * height as usize;
    let holds = |bytes: usize| data.get(..bytes).ok_or_else(|| wrong("it is too short"));
    match format {
        FrameFormat::RAWRGB => Ok(holds(3 * pixels)?.to_vec()),
        FrameFormat::RAWBGR => {
            Ok(holds(3 * pixels)?.chunks_exact(3).flat_map(|p| [p[2], p[1], p[0]]).collect())
        }
        FrameFormat::GRAY => Ok(holds(pixels)?.iter().flat_map(|v| [*v; 3]).collect()),
        FrameFormat::YUYV => Ok(holds(2 * pixels)?
            .chunks_exact(4)
            .flat_map(|p| [rgb(p[0], p[1], p[3]), rgb(p[2], p[1], p[3])])
            .flatten()
            .collect()),
        FrameFormat::NV12 => {
            let all = holds(pixels + pixels / 2)?;
            let (luma, chroma) = all.split_at(pixels);
            let width = (width as usize).max(1);
            let at = |n: usize| {
                let place = n / width / 2 * width + n % width / 2 * 2;
                let of = |offset: usize| chroma.get(place + offset).copied().unwrap_or(128);
                (of(0), of(1))
            };
            Ok(luma.iter().enumerate().flat_map(|(n, y)| rgb(*y, at(n).0, at(n).1)).collect())
        }
        FrameFormat::MJPEG => {
            let picture = image::load_from_memory_with_format(data, image::ImageFormat::Jpeg)
                .map_err(|e| wrong(&e.to_string()))?
                .into_rgb8();
            if (picture.width(), picture.height()) != (width, height) {
                return Err(wrong(&format!("it holds {} x {}", picture.width(), picture.height())));
            }
            Ok(picture.into_raw())
        }
    }
}

/// ITU-R BT.601 with luma from 16 to 235.
fn rgb(y: u8, u: u8, v: u8) -> [u8; 3] {
    let (y, u, v) = (f32::from(y) - 16.0, f32::from(u) - 128.0, f32::from(v) - 128.0);
    let y = y * (255.0 / 219.0);
    [y + 1.596 * v, y - 0.392 * u - 0.813 * v, y + 2.017 * u].map(|c| c.round().clamp(0.0, 255.0) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_video_are_those_of_the_standard() {
        // BT.601, 75 % bars and the ends of grey
        for ((y, u, v), expected) in [
            ((16, 128, 128), [0, 0, 0]),
            ((235, 128, 128), [255, 255, 255]),
            ((65, 100, 212), [191, 0, 0]),
            ((112, 72, 58), [0, 191, 0]),
            ((35, 212, 114), [0, 0, 191]),
        ] {
            let found = rgb(y, u, v);
            let off = found.iter().zip(expected).map(|(a, b)| a.abs_diff(b)).max();
            assert!(off.is_some_and(|off| off <= 2), "{found:?}, expected {expected:?}");
        }
    }

    #[test]
    fn every_format_is_decoded_and_a_short_frame_told() {
        let grey = |n: usize| vec![[255u8, 255, 255]; n].concat();
        let (width, height) = (4, 2);
        let cases = [
            (FrameFormat::YUYV, [235u8, 128, 235, 128].repeat(4)),
            (FrameFormat::NV12, [vec![235u8; 8], vec![128; 4]].concat()),
            (FrameFormat::RAWRGB, vec![255; 24]),
            (FrameFormat::RAWBGR, vec![255; 24]),
            (FrameFormat::GRAY, vec![255; 8]),
        ];
        for (format, data) in cases {
            assert_eq!(decode(format, &data, width, height), Ok(grey(8)), "{format:?}");
            let short = decode(format, &data[..data.len() - 1], width, height).expect_err("cut").to_string();
            assert!(short.contains("4 x 2") && short.contains("too short"), "{short}");
        }
        assert_eq!(decode(FrameFormat::RAWBGR, &[1, 2, 3], 1, 1), Ok(vec![3, 2, 1]));
        let mut jpeg = Vec::new();
        let picture = image::RgbImage::from_pixel(16, 8, image::Rgb([200, 30, 60]));
        picture.write_to(&mut std::io::Cursor::new(&mut jpeg), image::ImageFormat::Jpeg).expect("encoded");
        let back = decode(FrameFormat::MJPEG, &jpeg, 16, 8).expect("decoded");
        assert!(
            back.chunks_exact(3)
                .all(|p| p[0].abs_diff(200) < 6 && p[1].abs_diff(30) < 6 && p[2].abs_diff(60) < 6)
        );
        assert!(
            decode(FrameFormat::MJPEG, &jpeg, 8, 8).is_err()
                && decode(FrameFormat::MJPEG, &jpeg[..40], 16, 8).is_err()
        );
    }

    #[test]
    fn a_camera_that_is_not_there_gives_an_error_and_no_panic() {
        let error = take(987, Duration::from_secs(20)).expect_err("no such camera");
        assert!(matches!(error, ColourError::Camera { index: 987, .. }), "{error}");
        assert!(discover().windows(2).all(|w| w[0].0 <= w[1].0));
    }
}
