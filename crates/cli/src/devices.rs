//! Stages and cameras as the command line names them: `--device sim|serial:PATH|usb:VID:PID[:SERIAL]`,
//! `--camera sim[:SOCKET]|v4l:N|uvc:N|genicam:ID`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::Duration;
#[cfg(any(feature = "cameras", feature = "genicam"))]
use std::time::{SystemTime, UNIX_EPOCH};

use gonio_driver::camera::SocketCamera;
use gonio_driver::stage::Reopen;
use gonio_driver::transport::{Transport, UsbAddress, UsbTransport};
use gonio_instrument::{Camera, Description};

use crate::outcome::Failure;
use crate::rig::StageNote;

/// A stage by its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StageName {
    /// The virtual instrument.
    Sim,
    /// A serial port.
    Serial(String),
    /// A USB device.
    Usb(UsbAddress),
}

impl StageName {
    /// Reads what stands after `--device`.
    ///
    /// # Errors
    /// [`Failure::Usage`] with what is expected.
    pub fn parse(text: &str) -> Result<Self, Failure> {
        if text == "sim" {
            return Ok(Self::Sim);
        }
        if let Some(path) = text.strip_prefix("serial:").filter(|p| !p.is_empty()) {
            return Ok(Self::Serial(path.to_owned()));
        }
        if let Some(address) = text.strip_prefix("usb:") {
            return address.parse().map(Self::Usb).map_err(|e| Failure::usage(format!("--device {e}")));
        }
        Err(Failure::usage(format!(
            "--device {text}: expected sim, serial:PATH or usb:VID:PID[:SERIAL], for instance serial:/dev/ttyUSB0 or usb:1209:0001"
        )))
    }
}

/// A camera by its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CameraChoice {
    /// The virtual instrument's.
    Sim,
    /// One that another program lends.
    Socket(PathBuf),
    /// A camera of Video4Linux: number, path, serial number or name.
    V4l(String),
    /// A GenICam camera by its id; empty for the first that is found.
    Genicam(String),
}

impl CameraChoice {
    /// Reads what stands after `--camera`.
    ///
    /// # Errors
    /// [`Failure::Usage`] with what is expected.
    pub fn parse(text: &str) -> Result<Self, Failure> {
        if text == "sim" {
            return Ok(Self::Sim);
        }
        match text.split_once(':') {
            Some(("sim", socket)) if !socket.is_empty() => Ok(Self::Socket(PathBuf::from(socket))),
            Some(("v4l" | "uvc", name)) if !name.trim().is_empty() => Ok(Self::V4l(name.to_owned())),
            Some(("genicam", id)) => Ok(Self::Genicam(id.to_owned())),
            _ => Err(Failure::usage(format!(
                "--camera {text}: expected sim, sim:SOCKET, v4l:N (N of /dev/videoN, a path, a serial number or a name) or genicam:ID; \
                 `gonio doctor` lists the cameras of this machine"
            ))),
        }
    }
}

/// Opens a USB stage, and says how it is opened again: by the serial number that it has.
///
/// # Errors
/// [`Failure::Device`].
pub fn usb(address: &UsbAddress) -> Result<(Box<dyn Transport>, Reopen), Failure> {
    let stage = UsbTransport::open(address)?;
    let found = address.with_serial(stage.serial());
    let reopen: Reopen = Arc::new(move || Ok(Box::new(UsbTransport::open(&found)?)));
    Ok((Box::new(stage), reopen))
}

/// Whether stage and camera go together, and this program can open the camera.
///
/// # Errors
/// [`Failure::Usage`] with what to give instead.
pub fn check(stage: &StageName, camera: &CameraChoice) -> Result<(), Failure> {
    match (stage, camera) {
        (StageName::Serial(_) | StageName::Usb(_), CameraChoice::Sim) => Err(Failure::usage(
            "--camera sim goes with --device sim; for a virtual camera of another program give sim:SOCKET",
        )),
        (_, camera) => check_built(camera),
    }
}

/// Whether this program was built with what the camera takes.
///
/// # Errors
/// [`Failure::Usage`] with the feature to build with.
pub fn check_built(camera: &CameraChoice) -> Result<(), Failure> {
    match camera {
        CameraChoice::V4l(name) if !cfg!(feature = "cameras") => Err(Failure::usage(format!(
            "--camera v4l:{name}: this gonio was built without cameras; build it with --features cameras"
        ))),
        CameraChoice::Genicam(id) if !cfg!(feature = "genicam") => Err(Failure::usage(format!(
            "--camera genicam:{id}: this gonio was built without GenICam; build it with --features genicam (docs/hardware.md)"
        ))),
        _ => Ok(()),
    }
}

/// Opens a camera that is not the virtual instrument's own.
///
/// # Errors
/// [`Failure::Device`], or [`Failure::Usage`] for a kind of camera that this program was built without.
pub fn camera(
    choice: &CameraChoice,
    #[cfg_attr(not(any(feature = "cameras", feature = "genicam")), allow(unused_variables))]
    instrument: &Description,
    #[cfg_attr(not(any(feature = "cameras", feature = "genicam")), allow(unused_variables))]
    patience: Duration,
    #[cfg_attr(not(any(feature = "cameras", feature = "genicam")), allow(unused_variables))]
    notes: &SyncSender<StageNote>,
) -> Result<Box<dyn Camera>, Failure> {
    match choice {
        CameraChoice::Socket(socket) => Ok(Box::new(socket_camera(socket)?)),
        #[cfg(feature = "cameras")]
        CameraChoice::V4l(name) => v4l_camera(name, instrument, patience, notes),
        #[cfg(feature = "genicam")]
        CameraChoice::Genicam(id) => genicam_camera(id, instrument, patience, notes),
        other => Err(Failure::usage(format!("no camera of this kind can be opened here: {other:?}"))),
    }
}

#[cfg(feature = "cameras")]
fn v4l_camera(
    name: &str,
    instrument: &Description,
    patience: Duration,
    notes: &SyncSender<StageNote>,
) -> Result<Box<dyn Camera>, Failure> {
    use gonio_driver::camera::v4l::{Notice, Options, open_with};
    let (c, wanted) = (&instrument.camera, wanted(instrument));
    let told = notes.clone();
    let device = format!("camera {name}");
    let notices = move |notice: &Notice| match notice {
        Notice::Lost(error) => note(&told, true, format!("the camera is lost: {error}")),
        Notice::Returned { away } => {
            note(&told, false, format!("{device} is back after {away:.3?}, set up as before"));
        }
    };
    let options = Options { patience, notices: Some(Arc::new(notices)) };
    let camera = open_with(&name.parse()?, &wanted, options)?;
    let settings: Vec<String> =
        camera.settings().fixed.iter().map(|(what, value)| format!("{what} {value}")).collect();
    note(notes, false, format!("camera {name}: format {}, {}", camera.format(), settings.join(", ")));
    if let Some([shortest, longest]) = camera.exposure_limits() {
        let [low, high] = c.exposure_s;
        if shortest.as_secs_f64() > low * 1.001 || longest.as_secs_f64() < high * 0.999 {
            note(
                notes,
                true,
                format!(
                    "camera {name} exposes from {shortest:?} to {longest:?}; the instrument says {low} s to {high} s (camera.exposure_s)"
                ),
            );
        }
    }
    Ok(Box::new(camera))
}

#[cfg(feature = "genicam")]
fn genicam_camera(
    id: &str,
    instrument: &Description,
    patience: Duration,
    notes: &SyncSender<StageNote>,
) -> Result<Box<dyn Camera>, Failure> {
    let camera = gonio_driver::camera::genicam::open(id, &wanted(instrument), patience)?;
    note(notes, false, format!("camera {id}: format {}, {}", camera.format(), camera.settings().join(", ")));
    Ok(Box::new(camera))
}

/// What the instrument expects of its camera.
#[cfg(any(feature = "cameras", feature = "genicam"))]
pub(crate) fn wanted(instrument: &Description) -> gonio_driver::camera::raw::Wanted {
    let c = &instrument.camera;
    gonio_driver::camera::raw::Wanted {
        width: c.size[0],
        height: c.size[1],
        bits: c.bits,
        pattern: c.pattern,
    }
}

/// The camera of another program.
fn socket_camera(socket: &Path) -> Result<SocketCamera, Failure> {
    SocketCamera::connect(socket).map_err(|e| {
        let at = socket.display();
        let refused = std::os::unix::net::UnixStream::connect(socket).is_err();
        Failure::Device(if refused {
            format!("no camera listens at {at}; start it first, for instance `gonio sim --pty stage --camera-socket {at}`")
        } else {
            format!("camera at {at}: {e}")
        })
    })
}

#[cfg(any(feature = "cameras", feature = "genicam"))]
fn note(notes: &SyncSender<StageNote>, serious: bool, text: String) {
    let time = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    // a journal that is far behind loses notes, never time
    let _ = notes.try_send(StageNote { time, serious, text });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_and_cameras_are_read_as_the_contract_names_them() {
        assert_eq!(StageName::parse("sim").expect("sim"), StageName::Sim);
        let serial = StageName::parse("serial:/dev/ttyUSB0").expect("a port");
        assert_eq!(serial, StageName::Serial("/dev/ttyUSB0".into()));
        let StageName::Usb(address) = StageName::parse("usb:1209:0001:G7").expect("a stage") else {
            panic!("USB")
        };
        assert_eq!(address.serial.as_deref(), Some("G7"));
        let camera = |text| CameraChoice::parse(text).expect(text);
        assert_eq!(camera("sim:cam.sock"), CameraChoice::Socket("cam.sock".into()));
        assert_eq!(camera("v4l:0"), CameraChoice::V4l("0".into()));
        assert_eq!(camera("uvc:B8:C"), CameraChoice::V4l("B8:C".into()));
        assert_eq!(camera("genicam:Fake_1"), CameraChoice::Genicam("Fake_1".into()));
    }

    #[test]
    fn what_is_no_name_is_refused_with_what_is_expected() {
        for text in ["", "serial:", "ttyUSB0", "usb:", "usb:1209", "usb:zz:1"] {
            let error = StageName::parse(text).expect_err(text);
            assert!(error.to_string().contains("usb:VID:PID") && error.code() == 2, "{error}");
        }
        for text in ["", "sim:", "v4l:", "uvc: ", "webcam", "v4l"] {
            let error = CameraChoice::parse(text).expect_err(text);
            assert!(error.to_string().contains("v4l:N") && error.code() == 2, "{error}");
        }
    }
}
