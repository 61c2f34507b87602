//! A bad line: a wrapper around any transport that loses, damages, repeats, reorders and delays blocks of bytes in both directions, stalls, is
//! open in one direction only, and hangs up; all of it drawn from a seed.

use super::{Transport, Waker};
use crate::dice::Dice;
use gonio_instrument::DeviceError;
use std::time::{Duration, Instant};

/// How bad the line is: chances per block, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineFaults {
    /// A block is lost.
    pub loss: f64,
    /// One bit of a block is flipped.
    pub corruption: f64,
    /// A block comes twice.
    pub duplication: f64,
    /// A block is held back until after the next one.
    pub reorder: f64,
    /// The longest delay of a block; each is delayed by a random part of it.
    pub delay: Duration,
    /// The port hangs up after this many bytes in both directions together.
    pub hang_up_after: Option<u64>,
    /// After this many bytes in both directions nothing passes for so long; then all of it comes.
    pub stall: Option<(u64, Duration)>,
    /// After this many bytes in both directions what the device says is lost for so long, while it hears.
    pub half_open: Option<(u64, Duration)>,
}

/// A transport behind a bad line.
#[derive(Debug)]
pub struct FaultyTransport<T> {
    inner: T,
    faults: LineFaults,
    down: Direction,
    up: Direction,
    bytes: u64,
    stalled: Episode,
    half_open: Episode,
}

/// Something that happens once, for a while.
#[derive(Clone, Copy, Debug, Default)]
struct Episode(Option<Instant>);

impl Episode {
    /// The end of it while it lasts; it begins once enough bytes have passed.
    fn end(&mut self, now: Instant, bytes: u64, what: Option<(u64, Duration)>) -> Option<Instant> {
        let (after, long) = what?;
        if bytes < after {
            return None;
        }
        let end = *self.0.get_or_insert(now + long);
        (now < end).then_some(end)
    }
}

#[derive(Debug)]
struct Direction {
    dice: Dice,
    under_way: Vec<(Instant, Vec<u8>)>,
    held_back: Option<(Instant, Vec<u8>)>,
}

/// Longest time a block is held back when no other one follows.
const HOLD: Duration = Duration::from_millis(30);

impl<T: Transport> FaultyTransport<T> {
    /// Puts `inner` behind a line as bad as `faults`; the same seed draws the same fate for the n-th block.
    pub fn new(inner: T, faults: LineFaults, seed: u64) -> FaultyTransport<T> {
        let direction = |seed| Direction { dice: Dice(seed), under_way: Vec::new(), held_back: None };
        FaultyTransport {
            inner,
            faults,
            down: direction(seed),
            up: direction(!seed),
            bytes: 0,
            stalled: Episode::default(),
            half_open: Episode::default(),
        }
    }

    fn count(&mut self, bytes: usize) -> Result<(), DeviceError> {
        self.bytes += bytes as u64;
        if self.faults.hang_up_after.is_some_and(|limit| self.bytes > limit) {
            return Err(DeviceError::Gone { device: self.inner.name().to_owned() });
        }
        Ok(())
    }

    fn is_stalled(&mut self, now: Instant) -> Option<Instant> {
        self.stalled.end(now, self.bytes, self.faults.stall)
    }

    fn send_due(&mut self, now: Instant) -> Result<(), DeviceError> {
        if self.is_stalled(now).is_some() {
            return Ok(());
        }
        while let Some(bytes) = self.down.take_due(now) {
            self.inner.send(&bytes)?;
        }
        Ok(())
    }
}

impl<T: Transport> Transport for FaultyTransport<T> {
    fn name(&self) -> &str {
        self.inner.name()
    }

    fn waker(&self) -> Waker {
        self.inner.waker()
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<u8>, DeviceError> {
        let now = Instant::now();
        self.send_due(now)?;
        let stalled = self.is_stalled(now);
        if stalled.is_none()
            && let Some(bytes) = self.up.take_due(now)
        {
            return Ok(bytes);
        }
        let due = [self.down.next_due(), self.up.next_due()].into_iter().flatten().min();
        let next = if stalled.is_some() { stalled } else { due };
        let wait = next.map_or(timeout, |at| at.saturating_duration_since(now).min(timeout));
        let bytes = self.inner.receive(wait)?;
        self.count(bytes.len())?;
        let now = Instant::now();
        let deaf = self.half_open.end(now, self.bytes, self.faults.half_open).is_some();
        if !bytes.is_empty() && !deaf {
            self.up.enter(now, bytes, &self.faults);
        }
        self.send_due(now)?;
        if self.is_stalled(now).is_some() {
            return Ok(Vec::new());
        }
        Ok(self.up.take_due(now).unwrap_or_default())
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        self.count(bytes.len())?;
        let now = Instant::now();
        self.down.enter(now, bytes.to_vec(), &self.faults);
        self.send_due(now)
    }
}

impl Direction {
    fn enter(&mut self, now: Instant, mut bytes: Vec<u8>, faults: &LineFaults) {
        let [lost, damaged, twice, late] =
            [faults.loss, faults.corruption, faults.duplication, faults.reorder]
                .map(|c| self.dice.happens(c));
        let delay = faults.delay.mul_f64(self.dice.fraction());
        let place = self.dice.next();
        if lost {
            return;
        }
        if damaged {
            let bit = place % (bytes.len() as u64 * 8);
            if let Some(byte) = bytes.get_mut((bit / 8) as usize) {
                *byte ^= 1 << (bit % 8);
            }
        }
        let at = now + delay;
        let held = self.held_back.take();
        if late {
            self.held_back = Some((now + HOLD, bytes.clone()));
        } else {
            self.under_way.push((at, bytes.clone()));
        }
        if twice {
            self.under_way.push((at, bytes));
        }
        if let Some((_, held)) = held {
            self.under_way.push((at, held));
        }
    }

    fn take_due(&mut self, now: Instant) -> Option<Vec<u8>> {
        if self.held_back.as_ref().is_some_and(|(at, _)| now >= *at) {
            self.under_way.extend(self.held_back.take());
        }
        let (index, _) = self.under_way.iter().enumerate().min_by_key(|(_, (at, _))| *at)?;
        let due = self.under_way.get(index).is_some_and(|(at, _)| now >= *at);
        due.then(|| self.under_way.remove(index).1)
    }

    fn next_due(&self) -> Option<Instant> {
        self.under_way.iter().chain(&self.held_back).map(|(at, _)| *at).min()
    }
}

#[cfg(test)]
mod tests {
    use super::super::memory_pair;
    use super::*;

    fn fate(faults: LineFaults, seed: u64) -> Vec<Vec<u8>> {
        let (near, mut far) = memory_pair("line");
        let mut near = FaultyTransport::new(near, faults, seed);
        for n in 0..100u8 {
            near.send(&[n; 4]).expect("a line");
        }
        drop(near);
        std::iter::from_fn(|| far.receive(Duration::from_secs(5)).ok()).collect()
    }

    #[test]
    fn a_seed_gives_the_same_fate_twice_and_another_seed_another() {
        let bad =
            LineFaults { loss: 0.2, corruption: 0.2, duplication: 0.2, reorder: 0.2, ..Default::default() };
        assert_eq!(fate(bad, 7), fate(bad, 7));
        assert_ne!(fate(bad, 7), fate(bad, 8));
        assert_eq!(fate(LineFaults::default(), 7).len(), 100);
    }

    #[test]
    fn each_fault_does_what_its_name_says() {
        let only = |faults| fate(faults, 1);
        let all: Vec<Vec<u8>> = (0..100u8).map(|n| vec![n; 4]).collect();
        let lost = only(LineFaults { loss: 0.5, ..Default::default() });
        assert!((30..70).contains(&lost.len()) && lost.iter().all(|block| all.contains(block)));
        let damaged = only(LineFaults { corruption: 1.0, ..Default::default() });
        let flipped = |(a, b): (&Vec<u8>, &Vec<u8>)| -> u32 {
            a.iter().zip(b).map(|(a, b)| (a ^ b).count_ones()).sum()
        };
        assert!(damaged.iter().zip(&all).map(flipped).all(|bits| bits == 1));
        assert_eq!(only(LineFaults { duplication: 1.0, ..Default::default() }).len(), 200);
        let late = only(LineFaults { reorder: 0.3, ..Default::default() });
        assert!(late != all && late.len() >= 99);
    }

    #[test]
    fn a_stall_delays_everything_and_a_half_open_line_loses_one_direction() {
        let long = Duration::from_millis(60);
        let (near, mut far) = memory_pair("line");
        let faults = LineFaults { stall: Some((8, long)), ..Default::default() };
        let mut near = FaultyTransport::new(near, faults, 1);
        let start = Instant::now();
        for n in 0..4u8 {
            near.send(&[n; 4]).expect("a line");
        }
        let mut heard = Vec::new();
        while heard.len() < 4 {
            near.receive(Duration::from_millis(5)).expect("a line");
            heard.extend(far.receive(Duration::from_millis(1)).ok().filter(|b| !b.is_empty()));
        }
        assert!(start.elapsed() >= long);
        assert_eq!(heard, (0..4u8).map(|n| vec![n; 4]).collect::<Vec<_>>());

        let (near, mut far) = memory_pair("line");
        let faults = LineFaults { half_open: Some((4, long)), ..Default::default() };
        let mut near = FaultyTransport::new(near, faults, 1);
        near.send(&[1; 4]).expect("a line");
        assert_eq!(far.receive(Duration::from_secs(5)), Ok(vec![1; 4]), "the device hears");
        far.send(&[2; 4]).expect("a line");
        let start = Instant::now();
        while start.elapsed() < long {
            assert_eq!(near.receive(Duration::from_millis(5)), Ok(Vec::new()), "and is not heard");
        }
        far.send(&[3; 4]).expect("a line");
        assert_eq!(near.receive(Duration::from_secs(5)), Ok(vec![3; 4]), "but later");
    }

    #[test]
    fn it_hangs_up_when_it_should() {
        let (near, _far) = memory_pair("line");
        let mut near =
            FaultyTransport::new(near, LineFaults { hang_up_after: Some(10), ..Default::default() }, 1);
        assert!(near.send(&[0; 10]).is_ok());
        assert_eq!(near.send(&[0; 1]), Err(DeviceError::Gone { device: "line".into() }));
    }
}
