//! The stage through the FTDI driver and through libusb: commands, emergency stops, and everything that happens to plugs.

use gonio_driver::ports::list_ports;
use gonio_driver::stage::{Options, SerialStage, StageEvent};
use gonio_driver::transport::serial::{DEFAULT_BAUD, SerialTransport};
use gonio_driver::transport::{Transport, usb};
use gonio_instrument::{Cancel, DeviceError, Pose, Stage as _};
use gonio_optics::Angle;
use gonio_protocol::message::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::events::Events;
use super::{Guest, at, ms};
use crate::line::{Device, FromGuest};

/// Emergency stops per link.
const STOPS: usize = 1000;
/// Times that a plug is pulled.
const PULLS: usize = 5;
/// Longest time until a pulled plug is noticed, by the guest's clock.
const NOTICED_MS: f64 = 100.0;
/// Longest time from plugging in to a device that answers.
const RECOVERED_MS: f64 = 2000.0;
/// Nothing that is waited for here takes longer if it comes at all.
const PATIENCE: Duration = Duration::from_secs(20);

/// Ways to the stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// Through the serial adapter.
    Serial,
    /// Through its USB interface.
    Usb,
}

impl Link {
    /// What is plugged in for it.
    pub fn device(self) -> Device {
        match self {
            Link::Serial => Device::Serial,
            Link::Usb => Device::Usb,
        }
    }

    /// As `gonio scan --device` takes it.
    ///
    /// # Errors
    /// There is no such port.
    pub fn argument(self) -> Result<String, DeviceError> {
        match self {
            Link::Serial => adapter().map(|path| format!("serial:{path}")),
            Link::Usb => Ok(format!("usb:{}", self.address())),
        }
    }

    fn address(self) -> String {
        format!(
            "{:04x}:{:04x}:{}",
            crate::usb::descriptor::VENDOR,
            crate::stage::PRODUCT,
            crate::stage::SERIAL
        )
    }

    fn open(self) -> Result<Box<dyn Transport>, DeviceError> {
        Ok(match self {
            Link::Serial => Box::new(SerialTransport::open(&adapter()?, DEFAULT_BAUD)?),
            Link::Usb => Box::new(usb::open(&self.address().parse()?)?),
        })
    }
}

/// Where the adapter is now.
fn adapter() -> Result<String, DeviceError> {
    let absent = || DeviceError::Absent { device: "a serial adapter 0403:6001".to_owned() };
    let ports = list_ports().map_err(|_| absent())?;
    ports.into_iter().find(|p| p.usb_id == Some((0x0403, 0x6001))).map(|p| p.path).ok_or_else(absent)
}

/// A stage and what it tells.
fn connect(link: Link) -> Result<(SerialStage, Events<StageEvent>), String> {
    let events = Events::new();
    let heard = events.clone();
    let options = Options {
        events: Some(Arc::new(move |e: &StageEvent| heard.add(e.clone()))),
        reopen: Some(Arc::new(move || link.open())),
        patience: PATIENCE,
        ..Options::default()
    };
    let transport = link.open().map_err(|e| e.to_string())?;
    let stage = SerialStage::connect(transport, options).map_err(|e| e.to_string())?;
    Ok((stage, events))
}

/// Homes, moves, opens the shutter, reads back.
pub fn obeys(_guest: &mut Guest, link: Link) -> Result<(), String> {
    let (mut stage, _) = connect(link)?;
    let cancel = Cancel::new();
    let words = |e: DeviceError| e.to_string();
    let serial = stage.identity().serial;
    if serial != "GONIO-SIM" {
        return Err(format!("the firmware calls itself {serial:?}"));
    }
    let _ = stage.rearm();
    stage.home(&cancel).map_err(words)?;
    for (tilt, spin) in [(10.0, 0.0), (40.0, 90.0), (0.0, 0.0)] {
        let pose = Pose { tilt: Angle::from_degrees(tilt), spin: Angle::from_degrees(spin) };
        let there = stage.move_to(pose, &cancel).map_err(words)?;
        let off = (there.tilt.degrees() - tilt).abs().max((there.spin.degrees() - spin).abs());
        if off > 0.01 {
            return Err(format!("sent to {tilt}, {spin} it stands at {there:?}"));
        }
    }
    stage.set_shutter(true).map_err(words)?;
    let open = stage.status().map_err(words)?.shutter_open;
    stage.set_shutter(false).map_err(words)?;
    let closed = !stage.status().map_err(words)?.shutter_open;
    if !(open && closed) {
        return Err("the shutter does not follow".to_owned());
    }
    Ok(())
}

/// Emergency stops, half of them into a queue of other commands, from the call to the answer.
pub fn stops(guest: &mut Guest, link: Link) -> Result<(), String> {
    let (mut stage, events) = connect(link)?;
    let mut took = Vec::with_capacity(STOPS);
    for n in 0..STOPS {
        events.clear();
        let queue = if n % 2 == 0 { 0 } else { 12 };
        let pending: Vec<_> = (0..queue).filter_map(|_| stage.client().start(Command::Status).ok()).collect();
        let called = Instant::now();
        stage.client().emergency_stop().map_err(|e| e.to_string())?;
        let answered = events
            .wait(PATIENCE, |e| matches!(e, StageEvent::EmergencyStopped { .. }))
            .ok_or_else(|| format!("stop {n} was not answered within {PATIENCE:?}"))?;
        took.push(ms(answered - called));
        for p in pending {
            let _ = p.wait(PATIENCE);
        }
        stage.rearm().map_err(|e| format!("after stop {n}: {e}"))?;
    }
    took.sort_by(f64::total_cmp);
    let name = link.device().name();
    for (words, share) in [("p50", 0.5), ("p99.9", 0.999)] {
        let figure = format!("emergency stop through {name}, call to answer, {words}");
        guest.figure(&figure, at(&took, share), "ms", None, &format!("{STOPS} stops"))?;
    }
    Ok(())
}

/// Pulls the plug and plugs it in again, a few times.
pub fn unplugged(guest: &mut Guest, link: Link) -> Result<(), String> {
    let (mut stage, events) = connect(link)?;
    let cancel = Cancel::new();
    let _ = stage.rearm();
    stage.home(&cancel).map_err(|e| e.to_string())?;
    let (mut noticed, mut recovered) = (Vec::new(), Vec::new());
    for n in 0..PULLS {
        events.clear();
        let pulled = Instant::now();
        guest.control.plug(link.device(), false)?;
        let at = events
            .wait(PATIENCE, |e| matches!(e, StageEvent::HungUp(_)))
            .ok_or_else(|| format!("pull {n} was not noticed; told: {:?}", events.all()))?;
        noticed.push(ms(at - pulled));
        std::thread::sleep(Duration::from_millis(300));
        let plugged = Instant::now();
        guest.control.plug(link.device(), true)?;
        let at = events
            .wait(PATIENCE, |e| matches!(e, StageEvent::Returned { .. } | StageEvent::Shifted { .. }))
            .ok_or_else(|| format!("after pull {n} it did not come back; told: {:?}", events.all()))?;
        recovered.push(ms(at - plugged));
        let status = stage.status().map_err(|e| format!("after pull {n}: {e}"))?;
        if !status.homed {
            return Err(format!("after pull {n} the positions are gone"));
        }
        let _ = stage.rearm();
    }
    let name = link.device().name();
    longest(guest, name, &mut noticed, &mut recovered)
}

/// Tells the longest times until a pulled plug was noticed, and until the device was back.
///
/// # Errors
/// The channel is broken.
pub fn longest(
    guest: &mut Guest,
    name: &str,
    noticed: &mut [f64],
    recovered: &mut [f64],
) -> Result<(), String> {
    let from = format!("longest of {} pulls", noticed.len());
    for (words, list, bound) in
        [("unplug noticed", noticed, NOTICED_MS), ("back after replug", recovered, RECOVERED_MS)]
    {
        list.sort_by(f64::total_cmp);
        guest.figure(&format!("{name}: {words}"), at(list, 1.0), "ms", Some(bound), &from)?;
    }
    Ok(())
}

/// The endpoint halts; the driver clears that, and nothing but time is lost.
pub fn halted(guest: &mut Guest) -> Result<(), String> {
    let (stage, events) = connect(Link::Usb)?;
    for n in 0..PULLS {
        guest.control.ask(&FromGuest::Halt { device: Device::Usb })?;
        stage.status().map_err(|e| format!("after halt {n}: {e}"))?;
        guest.control.ask(&FromGuest::Healed { device: Device::Usb })?;
    }
    let hung_up = events.all().iter().filter(|e| matches!(e, StageEvent::HungUp(_))).count();
    guest.figure(
        "usb: sessions lost to a halted endpoint",
        hung_up as f64,
        "",
        None,
        &format!("{PULLS} halts"),
    )
}

/// The device answers no transfer: commands fail in time, and all is well when it answers again.
pub fn silent(guest: &mut Guest) -> Result<(), String> {
    let (stage, events) = connect(Link::Usb)?;
    let device = Device::Usb;
    stage.status().map_err(|e| e.to_string())?;
    guest.control.ask(&FromGuest::Silence { device, on: true })?;
    let asked = Instant::now();
    let answer = stage.status();
    let waited = asked.elapsed();
    guest.control.ask(&FromGuest::Silence { device, on: false })?;
    match answer {
        Err(DeviceError::Timeout { .. }) => {}
        other => {
            return Err(format!("a silent device gave {other:?} after {waited:?}; told: {:?}", events.all()));
        }
    }
    if waited > Options::default().silence_timeout * 2 {
        return Err(format!("it took {waited:?} until the silence was told"));
    }
    let spoken = Instant::now();
    while let Err(error) = stage.status() {
        if spoken.elapsed() > PATIENCE {
            return Err(format!("it answers again, the driver still says: {error}"));
        }
    }
    guest.figure("usb: silent device told as such", ms(waited), "ms", Some(4000.0), "one silence")?;
    guest.figure("usb: back after a silence", ms(spoken.elapsed()), "ms", None, "one silence")
}
