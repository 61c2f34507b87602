//! A channel that loses, damages, repeats, delays and overtakes, in virtual time.

use std::collections::BTreeMap;
use std::time::Duration;

/// SplitMix64: enough randomness for a channel, and the same on every machine.
pub struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn percent(&mut self, chance: u64) -> bool {
        self.next() % 100 < chance
    }
}

/// How bad a channel is: chances in per cent, delay up to so many milliseconds.
#[derive(Clone, Copy, Debug)]
pub struct Weather {
    pub loss: u64,
    pub damage: u64,
    pub repeat: u64,
    pub delay_ms: u64,
}

/// One direction. Blocks of bytes ordered by arrival, then by entry.
pub struct Channel {
    dice: Dice,
    pub weather: Weather,
    under_way: BTreeMap<(Duration, u64), Vec<u8>>,
    entered: u64,
}

impl Channel {
    pub fn new(seed: u64, weather: Weather) -> Channel {
        Channel { dice: Dice(seed), weather, under_way: BTreeMap::new(), entered: 0 }
    }

    pub fn send(&mut self, now: Duration, bytes: &[u8]) {
        let copies = if self.dice.percent(self.weather.repeat) { 2 } else { 1 };
        for _ in 0..copies {
            if self.dice.percent(self.weather.loss) {
                continue;
            }
            let mut bytes = bytes.to_vec();
            if self.dice.percent(self.weather.damage) {
                let at = self.dice.next() as usize % bytes.len();
                bytes[at] ^= 1 << (self.dice.next() % 8);
            }
            let delay = Duration::from_micros(500 + self.dice.next() % (self.weather.delay_ms * 1000 + 1));
            self.entered += 1;
            self.under_way.insert((now + delay, self.entered), bytes);
        }
    }

    pub fn arrived(&mut self, now: Duration) -> Option<Vec<u8>> {
        let (&key, _) = self.under_way.first_key_value()?;
        if key.0 > now { None } else { self.under_way.remove(&key) }
    }

    pub fn next_arrival(&self) -> Option<Duration> {
        self.under_way.keys().next().map(|key| key.0)
    }
}
