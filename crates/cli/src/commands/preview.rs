//! `gonio preview`: one picture of a camera, to see that it looks where it should. No measurement.

use gonio_instrument::{Camera, Cancel, Description, Frame};
use gonio_render::picture::Picture;
use serde_json::json;
use std::time::Duration;

use crate::arguments::PreviewArguments;
use crate::devices::{self, CameraChoice};
use crate::outcome::{Failure, Outcome};
use crate::output::{Printer, check_free, shown, write_whole};
use crate::rig;

/// Longest wait for a colour frame.
#[cfg(feature = "cameras")]
const PATIENCE: Duration = Duration::from_secs(15);

/// What was seen.
struct Seen {
    picture: Picture,
    format: String,
    /// Lowest and highest count of a raw frame, and the exposure it took.
    raw: Option<(u16, u16, Duration)>,
}

/// Takes the picture and writes it as PNG.
///
/// # Errors
/// [`Failure::Usage`] for a camera or output that cannot be, [`Failure::Device`] for a camera that gives no picture.
pub fn run(a: &PreviewArguments, printer: Printer) -> Result<Outcome, Failure> {
    check_free(&a.output, a.force)?;
    let exposure =
        Duration::try_from_secs_f64(a.exposure_ms * 1e-3).ok().filter(|e| !e.is_zero()).ok_or_else(|| {
            Failure::usage(format!("--exposure-ms {}: expected a positive number", a.exposure_ms))
        })?;
    let choice = CameraChoice::parse(&a.camera)?;
    let seen = match &choice {
        CameraChoice::Sim => {
            return Err(Failure::usage(
                "--camera sim has nothing to look at without a scan; give sim:SOCKET, v4l:N or genicam:ID",
            ));
        }
        #[cfg(feature = "cameras")]
        CameraChoice::V4l(name) => of_video(name, a, exposure)?,
        other => {
            devices::check_built(other)?;
            let instrument = rig::instrument(&a.instrument)?;
            by_instrument(other, &instrument, exposure)?
        }
    };
    let png = seen.picture.to_png().map_err(|e| Failure::failed("the picture cannot be encoded", e))?;
    write_whole(&a.output, &png)?;
    let (width, height) = (seen.picture.width(), seen.picture.height());
    let counts = seen.raw.map_or_else(String::new, |(low, high, taken)| {
        format!("; counts {low} to {high} at {taken:?}, drawn from dark to bright")
    });
    let text = format!("{}: {width} x {height}, {}{counts}\n", a.output.display(), seen.format);
    let result = json!({
        "output": shown(&a.output), "camera": a.camera, "width": width, "height": height, "format": seen.format,
        "counts": seen.raw.map(|(low, high, _)| [low, high]), "exposure_s": seen.raw.map(|(_, _, e)| e.as_secs_f64()),
    });
    printer.result(&text, &result);
    Ok(Outcome::Done)
}

/// In colour where the camera has any, else raw in a format and size of its own.
#[cfg(feature = "cameras")]
fn of_video(name: &str, a: &PreviewArguments, exposure: Duration) -> Result<Seen, Failure> {
    use gonio_driver::camera::{colour, v4l};
    let name: v4l::CameraName = name.parse()?;
    let facts = v4l::look_at(&name)?;
    if let (false, Some(index)) = (a.raw, facts.colour_number()) {
        let taken = colour::take(index, PATIENCE).map_err(|e| Failure::Device(e.to_string()))?;
        let pixel = |x: u32, y: u32| {
            let at = 3 * (y as usize * taken.width as usize + x as usize);
            [0, 1, 2].map(|c| taken.rgb.get(at + c).copied().unwrap_or(0))
        };
        let picture = Picture::from_fn(taken.width, taken.height, pixel);
        return Ok(Seen { picture, format: taken.format, raw: None });
    }
    let wanted = facts.largest_raw().ok_or_else(|| {
        Failure::Device(format!(
            "{name} offers no format that can be shown; `gonio doctor` lists what it offers"
        ))
    })?;
    let mut camera = v4l::open(&name, &wanted)?;
    let format = camera.format().to_owned();
    let frame = camera.capture(exposure, &Cancel::new())?;
    Ok(grey(&frame, format))
}

/// Raw, in the size of an instrument.
fn by_instrument(
    choice: &CameraChoice,
    instrument: &Description,
    exposure: Duration,
) -> Result<Seen, Failure> {
    let (notes, _nobody) = std::sync::mpsc::sync_channel(16);
    let mut camera = devices::camera(choice, instrument, Duration::ZERO, &notes)?;
    let frame = camera.capture(exposure, &Cancel::new())?;
    Ok(grey(&frame, format!("{} bit raw", instrument.camera.bits)))
}

/// A raw frame as grey, stretched from its darkest to its brightest counts (all but a thousandth at each end), with the gamma of screens.
fn grey(frame: &Frame, format: String) -> Seen {
    let mut sorted = frame.pixels.clone();
    sorted.sort_unstable();
    let at = |share: f64| {
        sorted.get((share * sorted.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(0)
    };
    let (low, high) = (f64::from(at(0.001)), f64::from(at(0.999)));
    let range = (high - low).max(1.0);
    let pixel = |x: u32, y: u32| {
        let count = frame.pixels.get(y as usize * frame.width as usize + x as usize).copied().unwrap_or(0);
        let level = ((f64::from(count) - low) / range).clamp(0.0, 1.0).powf(1.0 / 2.2);
        [(level * 255.0).round() as u8; 3]
    };
    Seen {
        picture: Picture::from_fn(frame.width, frame.height, pixel),
        format,
        raw: Some((at(0.0), at(1.0), frame.exposure)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(seen: &Seen, x: u32, y: u32) -> [u8; 3] {
        seen.picture.get(x, y).expect("inside")
    }

    #[test]
    fn a_raw_frame_is_stretched_over_the_whole_range_of_grey() {
        let frame = Frame {
            width: 50,
            height: 2,
            pixels: (0..100).map(|n| 1000 + n * 10).collect(),
            exposure: Duration::from_millis(3),
            sequence: 1,
            stamp: Duration::ZERO,
            sensor_temperature_c: None,
        };
        let seen = grey(&frame, "Y12".into());
        assert_eq!(seen.raw, Some((1000, 1990, Duration::from_millis(3))));
        assert_eq!((pixel(&seen, 0, 0), pixel(&seen, 49, 1)), ([0; 3], [255; 3]));
        assert!(pixel(&seen, 10, 0)[0] < pixel(&seen, 11, 0)[0]);
        let blank = grey(&Frame { pixels: vec![7; 100], ..frame }, String::new());
        assert_eq!(pixel(&blank, 3, 1), [0; 3], "a frame without structure");
    }
}
