//! The client against a device that is nothing but the protocol: what async callers see, and what is sent when.

use gonio_driver::stage::{Client, Options};
use gonio_driver::transport::{MemoryTransport, Transport, memory_pair};
use gonio_instrument::DeviceError;
use gonio_protocol::device::{Device, DeviceEvent, Identity};
use gonio_protocol::hello::{Serial, Version};
use gonio_protocol::message::{Command, Outcome, Reason, Reply, Status, Telemetry, ToHost};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Answers shutter commands at once, homing never, and all else with a refusal, until its line ends. Tells every command it gets.
fn device(mut line: MemoryTransport) -> (Receiver<Command>, JoinHandle<()>) {
    let (told, commands) = channel();
    let thread = std::thread::spawn(move || {
        let start = Instant::now();
        let identity = Identity::new(Version { major: 3, minor: 1, patch: 4 }, 9, Serial::new("FAKE"));
        let mut device = Device::new(identity);
        loop {
            while let Some(frame) = device.poll_transmit(start.elapsed()) {
                if line.send(frame.as_slice()).is_err() {
                    return;
                }
            }
            let Ok(bytes) = line.receive(Duration::from_millis(5)) else { return };
            let mut input = bytes.as_slice();
            while let Some(event) = device.receive(start.elapsed(), &mut input) {
                match event {
                    DeviceEvent::Command { id, command } => {
                        // The test may have seen enough.
                        let _ = told.send(command);
                        match command {
                            Command::Shutter { .. } => {
                                device.reply(id, Reply::Accepted);
                                device.reply(id, Reply::Done(Outcome::Nothing));
                            }
                            Command::Home => device.reply(id, Reply::Accepted),
                            _ => device.reply(id, Reply::Rejected(Reason::Busy)),
                        }
                    }
                    DeviceEvent::Heartbeat { counter } => {
                        let status = Status { boot: 9, ..Status::default() };
                        device.tell_now(ToHost::Telemetry(Telemetry { counter, status }));
                    }
                    DeviceEvent::EmergencyStop { id } => device.emergency_stopped(id),
                    DeviceEvent::Session { .. } => {}
                }
            }
        }
    });
    (commands, thread)
}

fn client() -> (Client, Receiver<Command>, JoinHandle<()>) {
    let (near, far) = memory_pair("fake");
    let (commands, thread) = device(far);
    (Client::connect(Box::new(near), Options::default()).expect("a session"), commands, thread)
}

#[test]
fn async_callers_wait_for_many_commands_at_once() {
    let (client, _commands, _thread) = client();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().expect("a runtime");
    runtime.block_on(async {
        let open = client.execute(Command::Shutter { open: true });
        let refused = client.execute(Command::Sensors);
        let close = client.execute(Command::Shutter { open: false });
        let (open, refused, close) = tokio::join!(open, refused, close);
        assert_eq!((open, close), (Ok(Outcome::Nothing), Ok(Outcome::Nothing)));
        assert!(matches!(refused, Err(DeviceError::Refused { .. })), "{refused:?}");
        // A homing that never ends does not keep the runtime from anything.
        let home = tokio::time::timeout(Duration::from_millis(50), client.execute(Command::Home)).await;
        assert!(home.is_err());
        assert_eq!(client.execute(Command::Shutter { open: true }).await, Ok(Outcome::Nothing));
    });
    assert_eq!((client.identity().firmware.as_str(), client.identity().boot_counter), ("3.1.4", 9));
}

#[test]
fn dropping_the_client_asks_for_a_stop_and_a_closed_shutter_last() {
    let (client, commands, thread) = client();
    let _never = client.start(Command::Home).expect("a client");
    assert_eq!(commands.recv(), Ok(Command::Home));
    drop(client);
    thread.join().expect("the line has ended");
    let told: Vec<Command> = commands.iter().collect();
    assert_eq!(told, [Command::Stop, Command::Shutter { open: false }]);
}

#[test]
fn a_dropped_client_ends_what_is_under_way() {
    let (client, commands, _thread) = client();
    let home = client.start(Command::Home).expect("a client");
    assert_eq!(commands.recv(), Ok(Command::Home));
    assert_eq!(home.wait(Duration::from_millis(20)), None);
    drop(client);
    assert!(matches!(home.wait(Duration::from_secs(60)), Some(Err(DeviceError::Gone { .. }))));
}
