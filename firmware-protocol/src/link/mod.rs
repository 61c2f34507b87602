//! A reliable, ordered link over a byte stream that loses, damages, repeats and reorders; the same at both ends.
//!
//! Data frames carry a sequence number from 0 and are kept until the peer's cumulative acknowledgement passes them.
//! At most `min(WINDOW, peer's window)` are under way. The receiver holds frames that came too early and hands them over
//! in order. Every frame carries an acknowledgement; where nothing else is to be sent, one goes alone after [`ACK_DELAY`]
//! (at once when a frame came out of turn). On time-out the oldest frame is sent again and the time-out doubled.
//! Datagrams overtake everything.

pub mod rtt;

use crate::frame::{Body, Decoder, Encoded, FrameError, Header, Kind, Packet, encode};
use crate::hello::Hello;
use core::fmt;
use core::time::Duration;
use rtt::RoundTrip;

/// Data frames held in each direction.
pub const WINDOW: usize = 8;
/// How long an acknowledgement waits for a frame to travel with.
pub const ACK_DELAY: Duration = Duration::from_millis(5);
/// Datagrams waiting to be sent.
const DATAGRAMS: usize = 4;

/// Counters of a link since it was made; they survive a change of session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Frames sent, repeats and acknowledgements included.
    pub sent: u64,
    /// Frames received whole and for this session.
    pub received: u64,
    /// Data frames sent again.
    pub retransmits: u64,
    /// Data frames received again.
    pub duplicates: u64,
    /// Runs of bytes thrown away because the checksum did not hold or no frame could be made of them.
    pub damaged: u64,
    /// Smoothed round trip.
    pub round_trip: Option<Duration>,
    /// Current retransmission time-out.
    pub timeout: Duration,
}

/// What the link cannot deal with itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Received {
    /// A greeting.
    Hello(Hello),
    /// Data, in its turn.
    Data(Body),
    /// A datagram of this session.
    Datagram(Body),
    /// A sound frame of another session.
    Foreign {
        /// That session.
        session: u32,
        /// What it was for.
        kind: Kind,
        /// What it said.
        body: Body,
    },
    /// Bytes were thrown away.
    Damaged(FrameError),
}

/// The link takes nothing more now: [`Link::poll_transmit`], wait for acknowledgements, try again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

impl fmt::Display for Full {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "no session, or {WINDOW} frames wait for their acknowledgement; try again after the next one"
        )
    }
}

impl core::error::Error for Full {}

#[derive(Clone, Copy, Debug)]
struct Outgoing {
    body: Body,
    sent_at: Duration,
    times: u32,
}

/// One end of the link.
#[derive(Clone, Debug)]
pub struct Link {
    session: Option<u32>,
    peer_window: u16,
    decoder: Decoder,
    round_trip: RoundTrip,
    // Sending: [base, fresh) sent and not acknowledged, [fresh, next) queued.
    outgoing: [Option<Outgoing>; WINDOW],
    base: u16,
    fresh: u16,
    next: u16,
    timer: Option<Duration>,
    datagrams: [Option<Body>; DATAGRAMS],
    // Receiving.
    incoming: [Option<Body>; WINDOW],
    expected: u16,
    ack_at: Option<Duration>,
    statistics: Statistics,
}

impl Default for Link {
    fn default() -> Self {
        Self::new()
    }
}

impl Link {
    /// A link without a session: it decodes, and sends nothing.
    pub const fn new() -> Self {
        Link {
            session: None,
            peer_window: 1,
            decoder: Decoder::new(),
            round_trip: RoundTrip::new(),
            outgoing: [None; WINDOW],
            base: 0,
            fresh: 0,
            next: 0,
            timer: None,
            datagrams: [None; DATAGRAMS],
            incoming: [None; WINDOW],
            expected: 0,
            ack_at: None,
            statistics: Statistics {
                sent: 0,
                received: 0,
                retransmits: 0,
                duplicates: 0,
                damaged: 0,
                round_trip: None,
                timeout: rtt::INITIAL_RTO,
            },
        }
    }

    /// Starts a session: sequence numbers from 0, everything queued for an earlier session dropped.
    pub fn open(&mut self, session: u32, peer_window: u16) {
        let (decoder, statistics) = (self.decoder.clone(), self.statistics);
        *self = Link {
            session: Some(session),
            peer_window: peer_window.max(1),
            decoder,
            statistics,
            ..Link::new()
        };
    }

    /// Ends the session; nothing more is sent.
    pub fn close(&mut self) {
        let (decoder, statistics) = (self.decoder.clone(), self.statistics);
        *self = Link { decoder, statistics, ..Link::new() };
    }

    /// The session under way.
    pub fn session(&self) -> Option<u32> {
        self.session
    }

    /// Queues data. An error leaves the link as it was.
    pub fn send(&mut self, body: Body) -> Result<(), Full> {
        if usize::from(self.next.wrapping_sub(self.base)) >= WINDOW {
            return Err(Full);
        }
        let slot = self.outgoing.get_mut(slot_of(self.next)).ok_or(Full)?;
        *slot = Some(Outgoing { body, sent_at: Duration::ZERO, times: 0 });
        self.next = self.next.wrapping_add(1);
        Ok(())
    }

    /// Queues a datagram, before all data. When the small queue is full the oldest is dropped: datagrams are
    /// things of which the newest counts.
    pub fn send_datagram(&mut self, body: Body) {
        if self.datagrams.iter().all(Option::is_some) {
            self.datagrams.rotate_left(1);
            if let Some(last) = self.datagrams.last_mut() {
                *last = Some(body);
            }
        } else if let Some(free) = self.datagrams.iter_mut().find(|slot| slot.is_none()) {
            *free = Some(body);
        }
    }

    /// Data frames that can still be queued.
    pub fn free(&self) -> usize {
        WINDOW - usize::from(self.next.wrapping_sub(self.base)).min(WINDOW)
    }

    /// All data handed to [`Link::send`] has been acknowledged.
    pub fn is_flushed(&self) -> bool {
        self.base == self.next
    }

    /// Takes bytes from the front of `input` until something comes out or none are left.
    pub fn receive(&mut self, now: Duration, input: &mut &[u8]) -> Option<Received> {
        loop {
            if let Some(body) = self.take_in_order() {
                self.ack_at = Some(self.ack_at.unwrap_or(now + ACK_DELAY));
                return Some(Received::Data(body));
            }
            let (&byte, rest) = input.split_first()?;
            *input = rest;
            match self.decoder.push(byte) {
                None => {}
                Some(Err(error)) => {
                    self.statistics.damaged += 1;
                    return Some(Received::Damaged(error));
                }
                Some(Ok(Packet::Hello(hello))) => return Some(Received::Hello(hello)),
                Some(Ok(Packet::Frame(header, body))) => {
                    if let Some(received) = self.frame(now, &header, body) {
                        return Some(received);
                    }
                }
            }
        }
    }

    /// The next frame to send, if any is due.
    pub fn poll_transmit(&mut self, now: Duration) -> Option<Encoded> {
        let session = self.session?;
        if let Some(body) = self.take_datagram() {
            return Some(self.emit(session, Kind::Datagram, 0, &body));
        }
        if self.timer.is_some_and(|at| now >= at) {
            self.round_trip.back_off();
            self.timer = Some(now + self.round_trip.rto());
            let seq = self.base;
            if let Some(out) = self.outgoing.get_mut(slot_of(seq)).and_then(Option::as_mut) {
                out.times += 1;
                out.sent_at = now;
                let body = out.body;
                self.statistics.retransmits += 1;
                return Some(self.emit(session, Kind::Data, seq, &body));
            }
        }
        let in_flight = self.fresh.wrapping_sub(self.base);
        if self.fresh != self.next && in_flight < self.peer_window {
            let seq = self.fresh;
            if let Some(out) = self.outgoing.get_mut(slot_of(seq)).and_then(Option::as_mut) {
                out.times = 1;
                out.sent_at = now;
                let body = out.body;
                self.fresh = self.fresh.wrapping_add(1);
                self.timer = Some(self.timer.unwrap_or(now + self.round_trip.rto()));
                return Some(self.emit(session, Kind::Data, seq, &body));
            }
        }
        if self.ack_at.is_some_and(|at| now >= at) {
            return Some(self.emit(session, Kind::Ack, 0, &Body::EMPTY));
        }
        None
    }

    /// When [`Link::poll_transmit`] will next have something to send, unless bytes come before; `Duration::ZERO` for at once.
    pub fn next_timeout(&self) -> Option<Duration> {
        self.session?;
        let sendable = self.fresh != self.next && self.fresh.wrapping_sub(self.base) < self.peer_window;
        if sendable || self.datagrams.iter().any(Option::is_some) {
            return Some(Duration::ZERO);
        }
        match (self.timer, self.ack_at) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    /// Counters.
    pub fn statistics(&self) -> Statistics {
        Statistics {
            round_trip: self.round_trip.smoothed().or(self.statistics.round_trip),
            timeout: self.round_trip.rto(),
            ..self.statistics
        }
    }

    fn take_datagram(&mut self) -> Option<Body> {
        let first = self.datagrams.first_mut()?.take()?;
        self.datagrams.rotate_left(1);
        Some(first)
    }

    fn emit(&mut self, session: u32, kind: Kind, seq: u16, body: &Body) -> Encoded {
        self.ack_at = None;
        self.statistics.sent += 1;
        encode(&Header { kind, session, seq, ack: self.expected }, body)
    }

    fn take_in_order(&mut self) -> Option<Body> {
        let body = self.incoming.get_mut(slot_of(self.expected))?.take()?;
        self.expected = self.expected.wrapping_add(1);
        Some(body)
    }

    fn frame(&mut self, now: Duration, header: &Header, body: Body) -> Option<Received> {
        if self.session != Some(header.session) {
            return Some(Received::Foreign { session: header.session, kind: header.kind, body });
        }
        self.statistics.received += 1;
        self.acknowledged(now, header.ack);
        match header.kind {
            Kind::Ack => None,
            Kind::Datagram => Some(Received::Datagram(body)),
            Kind::Data => {
                self.store(now, header.seq, body);
                None
            }
        }
    }

    fn store(&mut self, now: Duration, seq: u16, body: Body) {
        let ahead = usize::from(seq.wrapping_sub(self.expected));
        let slot = if ahead < WINDOW { self.incoming.get_mut(slot_of(seq)) } else { None };
        match slot {
            Some(slot) if slot.is_none() => *slot = Some(body),
            // Known already, or outside the window: the peer has missed an acknowledgement.
            _ => self.statistics.duplicates += 1,
        }
        if ahead != 0 {
            self.ack_at = Some(now);
        }
    }

    fn acknowledged(&mut self, now: Duration, ack: u16) {
        let newly = ack.wrapping_sub(self.base);
        let in_flight = self.fresh.wrapping_sub(self.base);
        if newly == 0 || newly > in_flight {
            return;
        }
        // A repeat among the frames covered makes the sample worthless (Karn): nobody knows which copy was answered,
        // and the others waited for it.
        let (mut repeated, mut newest) = (false, None);
        for _ in 0..newly {
            if let Some(out) = self.outgoing.get_mut(slot_of(self.base)).and_then(Option::take) {
                repeated |= out.times > 1;
                newest = Some(out.sent_at);
            }
            self.base = self.base.wrapping_add(1);
        }
        match newest {
            Some(sent_at) if !repeated => self.round_trip.sample(now.saturating_sub(sent_at)),
            _ => self.round_trip.reset(),
        }
        self.timer = (self.base != self.fresh).then(|| now + self.round_trip.rto());
    }
}

/// WINDOW divides 65,536, so a slot keeps its meaning when sequence numbers wrap.
fn slot_of(seq: u16) -> usize {
    usize::from(seq) % WINDOW
}
