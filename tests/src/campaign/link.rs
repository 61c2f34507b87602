//! Commands over a line that loses, repeats, overtakes and damages, in virtual time: each executed once, each answered.
//!
//! Host and device are the protocol's own two machines; between them lie two lines, one each way. Per frame: 10 % are lost, 2 % come twice,
//! 1 % are held back for 3 ms so that later ones overtake, and of what comes each bit is flipped with a chance of 1e-5. A frame takes
//! 0.5 ms plus up to 0.2 ms. The device answers at once with the number of commands it has executed, so a lost, repeated or exchanged one
//! shows in the answer.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use gonio_protocol::UNANSWERED;
use gonio_protocol::device::{Device, DeviceEvent, Identity};
use gonio_protocol::frame::Encoded;
use gonio_protocol::hello::{Serial, Version};
use gonio_protocol::host::{Host, HostEvent};
use gonio_protocol::message::{Command, Outcome, Reply};

use super::dice::Dice;
use super::{Figure, Settings, grouped};

/// Commands for the promise.
const FULL: u64 = 10_000_000;

/// How bad a line is.
#[derive(Clone, Copy, Debug)]
pub struct Weather {
    /// Chance that a frame is lost.
    pub loss: f64,
    /// Chance that it comes twice.
    pub duplication: f64,
    /// Chance that it is held back by [`Weather::held_back`].
    pub reordering: f64,
    /// Chance of each bit to be flipped.
    pub bit_errors: f64,
    /// Time of every frame on its way.
    pub delay: Duration,
    /// Longest addition to that.
    pub jitter: Duration,
    /// Added to a frame that is overtaken.
    pub held_back: Duration,
}

/// The weather of the promise.
pub const BAD: Weather = Weather {
    loss: 0.1,
    duplication: 0.02,
    reordering: 0.01,
    bit_errors: 1e-5,
    delay: Duration::from_micros(500),
    jitter: Duration::from_micros(200),
    held_back: Duration::from_millis(3),
};

/// One way. Frames ordered by arrival, then by entry.
struct Line {
    dice: Dice,
    weather: Weather,
    under_way: BTreeMap<(Duration, u64), (Encoded, Option<usize>)>,
    entered: u64,
    frames: u64,
    damaged: u64,
}

impl Line {
    fn new(dice: Dice, weather: Weather) -> Self {
        Self { dice, weather, under_way: BTreeMap::new(), entered: 0, frames: 0, damaged: 0 }
    }

    fn send(&mut self, now: Duration, frame: Encoded) {
        self.frames += 1;
        let copies = if self.dice.happens(self.weather.duplication) { 2 } else { 1 };
        for _ in 0..copies {
            if self.dice.happens(self.weather.loss) {
                continue;
            }
            let mut delay = self.weather.delay + self.weather.jitter.mul_f64(self.dice.fraction());
            if self.dice.happens(self.weather.reordering) {
                delay += self.weather.held_back;
            }
            let bits = frame.as_slice().len() * 8;
            // at these rates two errors in one frame are as rare as they are hard on the CRC: one is drawn
            let damage = self
                .dice
                .happens(1.0 - (1.0 - self.weather.bit_errors).powi(bits as i32))
                .then(|| self.dice.below(bits));
            self.damaged += u64::from(damage.is_some());
            self.entered += 1;
            self.under_way.insert((now + delay, self.entered), (frame, damage));
        }
    }

    /// The bytes of the next frame that has arrived by `now`, in `buffer`.
    fn arrived<'a>(&mut self, now: Duration, buffer: &'a mut [u8; 160]) -> Option<&'a [u8]> {
        let entry = self.under_way.first_entry()?;
        if entry.key().0 > now {
            return None;
        }
        let (frame, damage) = entry.remove();
        let bytes = frame.as_slice();
        let out = buffer.get_mut(..bytes.len())?;
        out.copy_from_slice(bytes);
        if let Some(bit) = damage {
            out[bit / 8] ^= 1 << (bit % 8);
        }
        Some(out)
    }

    fn next_arrival(&self) -> Option<Duration> {
        self.under_way.keys().next().map(|key| key.0)
    }
}

/// What came of the commands of one pair.
#[derive(Clone, Debug, Default)]
pub struct Outcomes {
    /// Commands given.
    pub commands: u64,
    /// Never executed, or never answered.
    pub lost: u64,
    /// Executed more than once.
    pub twice: u64,
    /// Executed out of their order, or answered with another's answer.
    pub wrong: u64,
    /// Sessions begun by the host.
    pub sessions: u64,
    /// Frames given to the lines, both ways.
    pub frames: u64,
    /// Frames that arrived damaged, both ways.
    pub damaged: u64,
    /// Data frames sent again, both ends.
    pub retransmits: u64,
    /// Latencies from the call to the final reply, in steps of [`STEP`].
    latencies: Vec<u32>,
}

/// Resolution of latencies.
const STEP: Duration = Duration::from_micros(20);
/// Latencies above this are counted together.
const LONGEST: Duration = Duration::from_secs(20);

impl Outcomes {
    fn add(&mut self, other: &Self) {
        self.commands += other.commands;
        self.lost += other.lost;
        self.twice += other.twice;
        self.wrong += other.wrong;
        self.sessions += other.sessions;
        self.frames += other.frames;
        self.damaged += other.damaged;
        self.retransmits += other.retransmits;
        self.latencies.resize(self.latencies.len().max(other.latencies.len()), 0);
        for (sum, n) in self.latencies.iter_mut().zip(&other.latencies) {
            *sum += n;
        }
    }

    fn note(&mut self, latency: Duration) {
        let slot = (latency.min(LONGEST).as_nanos() / STEP.as_nanos()) as usize;
        if self.latencies.len() <= slot {
            self.latencies.resize(slot + 1, 0);
        }
        self.latencies[slot] += 1;
    }

    /// The latency below which this share of the commands lies, ms.
    #[must_use]
    pub fn percentile_ms(&self, share: f64) -> f64 {
        let total: u64 = self.latencies.iter().map(|&n| u64::from(n)).sum();
        let wanted = (total as f64 * share).ceil() as u64;
        let mut seen = 0;
        for (slot, &n) in self.latencies.iter().enumerate() {
            seen += u64::from(n);
            if seen >= wanted {
                return (slot + 1) as f64 * STEP.as_secs_f64() * 1e3;
            }
        }
        f64::INFINITY
    }
}

/// Sends `commands`, at most `depth` at a time, from one host to one device through `weather`.
#[must_use]
pub fn exchange(commands: u64, depth: usize, weather: Weather, seed: u64, stream: u64) -> Outcomes {
    let mut host = Host::new(1, 100, Version::default());
    let mut device = Device::new(Identity::new(Version::default(), 1, Serial::new("CAMPAIGN")));
    let mut down = Line::new(Dice::new(seed, 2 * stream), weather);
    let mut up = Line::new(Dice::new(seed, 2 * stream + 1), weather);
    let mut out = Outcomes { commands, ..Outcomes::default() };
    // id → when it was asked for
    let mut waiting: BTreeMap<u32, Duration> = BTreeMap::new();
    let (mut next_id, mut executed, mut answered) = (0u32, 0u32, 0u64);
    let (mut now, mut buffer) = (Duration::ZERO, [0u8; 160]);
    // nothing that works takes a second a command
    let limit = Duration::from_secs(commands.max(1000));
    while answered < commands && now < limit {
        while host.is_connected() && waiting.len() < depth && u64::from(next_id) < commands && host.free() > 0
        {
            next_id += 1;
            if host.command(next_id, Command::CameraTrigger { exposure_us: next_id }).is_ok() {
                waiting.insert(next_id, now);
            }
        }
        while let Some(frame) = host.poll_transmit(now) {
            down.send(now, frame);
        }
        while let Some(frame) = device.poll_transmit(now) {
            up.send(now, frame);
        }
        let times = [host.next_timeout(), device.next_timeout(), down.next_arrival(), up.next_arrival()];
        now = now.max(times.into_iter().flatten().min().unwrap_or(limit));
        while let Some(mut input) = down.arrived(now, &mut buffer) {
            while let Some(event) = device.receive(now, &mut input) {
                match event {
                    DeviceEvent::Command { id, .. } => {
                        if id <= executed {
                            out.twice += 1;
                        } else if id != executed + 1 {
                            out.wrong += 1;
                        }
                        executed = executed.max(id);
                        device.reply(id, Reply::Done(Outcome::Triggered { count: executed }));
                    }
                    DeviceEvent::EmergencyStop { id } => device.emergency_stopped(id),
                    DeviceEvent::Session { .. } | DeviceEvent::Heartbeat { .. } => {}
                }
            }
        }
        while let Some(mut input) = up.arrived(now, &mut buffer) {
            while let Some(event) = host.receive(now, &mut input) {
                match event {
                    HostEvent::Connected(_) => {
                        out.sessions += 1;
                        for &id in waiting.keys() {
                            // a new link has room for what was under way
                            let _ = host.command(id, Command::CameraTrigger { exposure_us: id });
                        }
                    }
                    HostEvent::Reply { id, reply: Reply::Done(Outcome::Triggered { count }) } => {
                        // an answer that comes again in a new session is no second execution
                        if let Some(asked) = waiting.remove(&id) {
                            out.note(now - asked);
                            out.wrong += u64::from(count != id);
                            answered += 1;
                        }
                    }
                    _ => {}
                }
            }
        }
    }
    out.lost = commands - answered;
    out.frames = down.frames + up.frames;
    out.damaged = down.damaged + up.damaged;
    out.retransmits = host.statistics().link.retransmits + device.statistics().retransmits;
    out
}

fn all(settings: &Settings, commands: u64, depth: usize) -> Outcomes {
    let threads = settings.threads.max(1) as u64;
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads)
            .map(|n| {
                let share = commands / threads + u64::from(n < commands % threads);
                let stream = n + depth as u64 * 1000;
                scope.spawn(move || exchange(share, depth, BAD, settings.seed, stream))
            })
            .collect();
        let mut sum = Outcomes::default();
        for worker in workers {
            sum.add(&worker.join().expect("no line makes the link panic"));
        }
        sum
    })
}

/// Runs the campaign.
#[must_use]
pub fn figures(settings: &Settings) -> Vec<Figure> {
    let commands = settings.count(FULL, 2000);
    let start = Instant::now();
    let full = all(settings, commands, UNANSWERED);
    let seconds = start.elapsed().as_secs_f64();
    let single = all(settings, (commands / 20).max(500), 1);
    let size = format!("{} commands, {} at a time", grouped(full.commands), UNANSWERED);
    let one = format!("{} commands, one at a time", grouped(single.commands));
    let times = |o: &Outcomes| {
        let p = |share| o.percentile_ms(share);
        format!("{:.2} / {:.2} / {:.2} ms", p(0.5), p(0.99), p(0.999))
    };
    vec![
        Figure::exactly("commands lost", full.lost + single.lost, 0, &size),
        Figure::exactly("commands executed twice", full.twice + single.twice, 0, &size),
        Figure::exactly("commands out of order or answered wrongly", full.wrong + single.wrong, 0, &size),
        Figure::told("latency p50 / p99 / p99.9", times(&full), &size),
        Figure::told("latency p50 / p99 / p99.9", times(&single), &one),
        Figure::told(
            "frames sent, arrived damaged, sent again",
            format!("{}, {}, {}", grouped(full.frames), grouped(full.damaged), grouped(full.retransmits)),
            &size,
        ),
        Figure::told(
            "sessions begun anew",
            (full.sessions.saturating_sub(settings.threads.max(1) as u64)).to_string(),
            &size,
        ),
        Figure::told("rate", format!("{:.0} commands/s", commands as f64 / seconds), &size),
    ]
}
