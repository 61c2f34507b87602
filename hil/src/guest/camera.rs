//! The camera through uvcvideo and Video4Linux.

use gonio_driver::camera::v4l::{self, Notice, Options, Tally, V4lCamera, Wanted};
use gonio_instrument::{BayerPattern, Camera as _, Cancel, DeviceError, Frame};
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::Guest;
use super::events::Events;
use super::ms;
use super::stage::longest;
use crate::camera::chart;
use crate::line::{Device, FromGuest};

const SIZE: [u32; 2] = [160, 128];
/// Black level of the tiny instrument, counts.
const BLACK: f64 = 64.0;
const PULLS: usize = 5;
/// Frames torn at a time: more than a capture lets pass.
const TEARS: u32 = 8;
const PATIENCE: Duration = Duration::from_secs(20);
const SHORT: Duration = Duration::from_millis(1);
/// Captures over which numbers and counts are compared.
const GROUP: usize = 20;

fn wanted() -> Wanted {
    Wanted { width: SIZE[0], height: SIZE[1], bits: 12, pattern: BayerPattern::Rggb }
}

fn open() -> Result<(V4lCamera, Events<Notice>), String> {
    let events = Events::new();
    let heard = events.clone();
    let options =
        Options { patience: PATIENCE, notices: Some(Arc::new(move |n: &Notice| heard.add(n.clone()))) };
    let name = crate::camera::SERIAL.parse().map_err(|e| format!("{e}"))?;
    let camera = v4l::open_with(&name, &wanted(), options).map_err(|e| e.to_string())?;
    Ok((camera, events))
}

fn take(camera: &mut V4lCamera) -> Result<Frame, String> {
    camera.capture(SHORT, &Cancel::new()).map_err(|e| e.to_string())
}

/// The number on the chart, if the frame is whole.
fn number(frame: &Frame) -> Result<u64, String> {
    chart::read(&frame.pixels).ok_or_else(|| format!("frame {} is not one whole picture", frame.sequence))
}

/// Exposures as the camera took them; automatic off, gain at its least: the dark level is that of the sensor.
pub fn exposes(guest: &mut Guest) -> Result<(), String> {
    guest.control.ask(&FromGuest::Chart { on: false })?;
    let (mut camera, _) = open()?;
    for (asked, expected) in
        [(100, 100), (2_500, 2_500), (10_300, 10_500), (51_200, 51_000), (100_000, 100_000)]
    {
        let frame = camera
            .capture(Duration::from_micros(asked), &Cancel::new())
            .map_err(|e| format!("{asked} µs: {e}"))?;
        if frame.exposure != Duration::from_micros(expected) {
            return Err(format!(
                "asked for {asked} µs the camera takes {expected} µs; recorded: {:?}",
                frame.exposure
            ));
        }
        if (frame.width, frame.height, frame.pixels.len()) != (SIZE[0], SIZE[1], 160 * 128) {
            return Err(format!("a frame of {} x {} pixels", frame.width, frame.height));
        }
        let mean = frame.pixels.iter().map(|p| f64::from(*p)).sum::<f64>() / frame.pixels.len() as f64;
        if (mean - BLACK).abs() > 2.0 {
            return Err(format!("behind a closed shutter the mean is {mean:.1} counts, black is {BLACK}"));
        }
    }
    Ok(())
}

/// Sum of all that was counted.
fn counted(tally: Tally) -> i64 {
    (tally.taken + tally.passed + tally.damaged + tally.lost) as i64
}

/// How often the largest of [`GROUP`] values went up and down, from group to group.
fn drift(ahead: &[i64]) -> (i64, i64) {
    let largest: Vec<i64> = ahead.chunks(GROUP).filter_map(|g| g.iter().copied().max()).collect();
    let steps = largest.windows(2).map(|w| w[1] - w[0]);
    steps.fold((0, 0), |(up, down), step| (up + step.max(0), down + (-step).max(0)))
}

/// Every frame that the camera sent is taken, passed or told as lost: the numbers on the chart and the driver's counts go together.
///
/// What is compared is the number less the count. A frame lost unseen makes it larger for good; a count that is read late makes it smaller for
/// once, so the largest of a few captures is compared with that of the few before. It also gets smaller for good where uvcvideo's running number skips
/// though no frame was lost, as it does now and then when it has no free buffer: told, and no loss.
pub fn watched(guest: &mut Guest) -> Result<(), String> {
    guest.control.ask(&FromGuest::Chart { on: true })?;
    let (mut camera, events) = open()?;
    let begun = Instant::now();
    let mut ahead = Vec::new();
    let (mut first, mut last, mut restarts) = (None, 0, 0);
    while begun.elapsed() < guest.watch || ahead.len() < 2 * GROUP {
        let n = number(&take(&mut camera)?)?;
        ahead.push(n as i64 - counted(camera.tally()));
        for told in events.drain() {
            let now = begun.elapsed().as_secs_f64();
            let words = format!("{now:.1} s, frame {n}, {:?}: the camera told {told:?}", camera.tally());
            guest.control.tell(&FromGuest::Note(words))?;
            restarts += 1;
        }
        first.get_or_insert(n);
        last = n;
    }
    let seconds = begun.elapsed().as_secs_f64();
    guest.control.ask(&FromGuest::Chart { on: false })?;
    let (unseen, phantom) = drift(&ahead);
    let tally = camera.tally();
    let sent = last - first.unwrap_or(last);
    let from = format!(
        "{sent} frames in {seconds:.0} s: {} taken, {} passed, {} damaged, {} lost; {restarts} words of a lost stream",
        tally.taken, tally.passed, tally.damaged, tally.lost
    );
    guest.figure("camera: frames lost without being counted", unseen as f64, "", Some(0.0), &from)?;
    guest.figure("camera: told as lost though they were not", phantom as f64, "", None, "the same")?;
    guest.figure("camera: frame rate", sent as f64 / seconds, "1/s", None, "the same")
}

/// Frames broken off half-way are not given to anybody, and each is counted.
pub fn torn(guest: &mut Guest) -> Result<(), String> {
    guest.control.ask(&FromGuest::Chart { on: true })?;
    let (mut camera, _) = open()?;
    for n in 0..PULLS {
        let before = number(&take(&mut camera)?)?;
        guest.control.ask(&FromGuest::Tear { frames: TEARS })?;
        let after = number(&take(&mut camera)?).map_err(|e| format!("tear {n}: {e}"))?;
        if after <= before + u64::from(TEARS) {
            return Err(format!("tear {n}: frame {after} came after frame {before}, {TEARS} were torn"));
        }
    }
    guest.control.ask(&FromGuest::Chart { on: false })?;
    // uvcvideo keeps a torn frame to itself and leaves a gap in its numbers
    let tally = camera.tally();
    let torn = PULLS as u64 * u64::from(TEARS);
    if tally.damaged + tally.lost != torn {
        return Err(format!("{torn} frames were torn, counted: {tally:?}"));
    }
    Ok(())
}

/// Pulls the plug and plugs it in again, a few times; a capture under way waits for the camera.
pub fn unplugged(guest: &mut Guest) -> Result<(), String> {
    guest.control.ask(&FromGuest::Chart { on: true })?;
    let (mut camera, events) = open()?;
    take(&mut camera)?;
    let (mut noticed, mut recovered) = (Vec::new(), Vec::new());
    for n in 0..PULLS {
        events.clear();
        let pulled = Instant::now();
        guest.control.plug(Device::Camera, false)?;
        let at = events
            .wait(PATIENCE, |e| matches!(e, Notice::Lost(_)))
            .ok_or_else(|| format!("pull {n} was not noticed; told: {:?}", events.all()))?;
        noticed.push(ms(at - pulled));
        std::thread::sleep(Duration::from_millis(300));
        let plugged = Instant::now();
        guest.control.plug(Device::Camera, true)?;
        let frame =
            take(&mut camera).map_err(|e| format!("after pull {n}: {e}; told: {:?}", events.all()))?;
        recovered.push(ms(plugged.elapsed()));
        number(&frame)?;
        if frame.exposure != SHORT {
            return Err(format!("after pull {n} the exposure is {:?}", frame.exposure));
        }
    }
    guest.control.ask(&FromGuest::Chart { on: false })?;
    longest(guest, "camera", &mut noticed, &mut recovered)
}

/// The stream's endpoint halts: uvcvideo gives the stream up, the driver starts it anew.
pub fn halted(guest: &mut Guest) -> Result<(), String> {
    guest.control.ask(&FromGuest::Chart { on: true })?;
    let (mut camera, events) = open()?;
    take(&mut camera)?;
    let mut longest = Duration::ZERO;
    for n in 0..PULLS {
        guest.control.ask(&FromGuest::Halt { device: Device::Camera })?;
        let asked = Instant::now();
        let frame = loop {
            match camera.capture(SHORT, &Cancel::new()) {
                Ok(frame) => break frame,
                Err(error) if asked.elapsed() > PATIENCE => {
                    return Err(format!("after halt {n}: {error}; told: {:?}", events.all()));
                }
                Err(_) => {}
            }
        };
        longest = longest.max(asked.elapsed());
        number(&frame)?;
        guest.control.ask(&FromGuest::Healed { device: Device::Camera })?;
    }
    guest.control.ask(&FromGuest::Chart { on: false })?;
    guest.figure(
        "camera: next frame after a halted stream",
        ms(longest),
        "ms",
        None,
        &format!("longest of {PULLS} halts"),
    )
}

/// No frames come: a capture fails in time, and goes on when they come again.
pub fn silent(guest: &mut Guest) -> Result<(), String> {
    guest.control.ask(&FromGuest::Chart { on: true })?;
    let (mut camera, events) = open()?;
    take(&mut camera)?;
    let device = Device::Camera;
    guest.control.ask(&FromGuest::Silence { device, on: true })?;
    let asked = Instant::now();
    let answer = camera.capture(SHORT, &Cancel::new());
    let waited = asked.elapsed();
    guest.control.ask(&FromGuest::Silence { device, on: false })?;
    match answer {
        Err(DeviceError::Timeout { .. }) => {}
        other => return Err(format!("without frames a capture gave {other:?} after {waited:?}")),
    }
    let spoken = Instant::now();
    let frame = take(&mut camera).map_err(|e| format!("frames come again: {e}; told: {:?}", events.all()))?;
    number(&frame)?;
    guest.control.ask(&FromGuest::Chart { on: false })?;
    guest.figure("camera: missing frames told as such", ms(waited), "ms", Some(6000.0), "one silence")?;
    guest.figure("camera: back after a silence", ms(spoken.elapsed()), "ms", None, "one silence")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_unseen_shows_among_late_counts_and_skipped_numbers() {
        let mut ahead = vec![0; 100];
        // counts read late
        for place in [3, 25, 26, 70] {
            ahead[place] = -2;
        }
        assert_eq!(drift(&ahead), (0, 0));
        ahead[40..].iter_mut().for_each(|a| *a -= 3);
        assert_eq!(drift(&ahead), (0, 3), "numbers that were skipped");
        ahead[60..].iter_mut().for_each(|a| *a += 1);
        assert_eq!(drift(&ahead), (1, 3), "a frame lost unseen");
    }
}
