//! The guest's end of the control channel.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};

use crate::line::{Device, FromGuest, PORT, Reply};

/// An open channel.
#[derive(Debug)]
pub struct Control {
    write: File,
    read: BufReader<File>,
}

impl Control {
    /// Finds the port by its name and opens it.
    ///
    /// # Errors
    /// In words, where there is none.
    pub fn open() -> Result<Control, String> {
        let folder = "/sys/class/virtio-ports";
        let ports =
            std::fs::read_dir(folder).map_err(|e| format!("{folder}: {e}; this runs in the guest alone"))?;
        for port in ports.flatten() {
            let name = std::fs::read_to_string(port.path().join("name")).unwrap_or_default();
            if name.trim() == PORT {
                let path = std::path::Path::new("/dev").join(port.file_name());
                let at = |e: std::io::Error| format!("{}: {e}", path.display());
                let write = OpenOptions::new().read(true).write(true).open(&path).map_err(at)?;
                let read = BufReader::new(write.try_clone().map_err(at)?);
                return Ok(Control { write, read });
            }
        }
        Err(format!("no port {PORT} in {folder}"))
    }

    /// Tells something that wants no answer.
    ///
    /// # Errors
    /// The channel is broken.
    pub fn tell(&mut self, word: &FromGuest) -> Result<(), String> {
        let mut line = serde_json::to_string(word).map_err(|e| e.to_string())?;
        line.push('\n');
        self.write.write_all(line.as_bytes()).map_err(|e| format!("the channel to the host is broken: {e}"))
    }

    /// Asks for something and waits until it is done.
    ///
    /// # Errors
    /// The host's reason for not doing it; or the channel is broken.
    pub fn ask(&mut self, request: &FromGuest) -> Result<(), String> {
        self.tell(request)?;
        let mut line = String::new();
        self.read.read_line(&mut line).map_err(|e| format!("the channel to the host is broken: {e}"))?;
        match serde_json::from_str(&line) {
            Ok(Reply::Done) => Ok(()),
            Ok(Reply::Refused(why)) => Err(format!("the host refused {request:?}: {why}")),
            Err(e) => Err(format!("the host answered {line:?}: {e}")),
        }
    }

    /// Plugs a device in, or pulls it.
    ///
    /// # Errors
    /// As [`Control::ask`].
    pub fn plug(&mut self, device: Device, on: bool) -> Result<(), String> {
        self.ask(&FromGuest::Plug { device, on })
    }
}
