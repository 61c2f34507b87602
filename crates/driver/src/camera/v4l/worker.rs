//! The camera's thread (`gonio-camera`): it empties the stream all the time, answers one question after the other, and looks for a camera that was
//! unplugged.

use super::nodes::{Node, Places};
use super::session::{Damage, Session, monotonic};
use super::timing::{Question, SETTLE, gap};
use super::{Notice, Options, Tally};
use crate::camera::asking::{Request, check_depth};
use crate::camera::raw::Wanted;
use gonio_instrument::{DeviceError, Frame};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How long a frame is waited for before requests are looked at.
const GLANCE: Duration = Duration::from_millis(10);
/// How often a lost camera is looked for.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// A request under way.
struct Pending {
    request: Request,
    /// Once the exposure time is set.
    question: Option<Question>,
    /// When it is given up.
    end: Instant,
    /// Frames lost while it waited.
    lost: u64,
}

pub(super) struct Worker {
    pub name: String,
    pub wanted: Wanted,
    pub places: Places,
    pub node: Node,
    pub session: Option<Session>,
    pub requests: Receiver<Request>,
    pub options: Options,
    pub tally: Arc<Mutex<Tally>>,
    /// When the camera was opened, by the kernel's monotonic clock.
    pub opened: Duration,
    pub state: State,
}

/// What the thread remembers from frame to frame.
#[derive(Default)]
pub(super) struct State {
    pending: Option<Pending>,
    /// Number of the frame given last.
    number: u64,
    /// The driver's number of the frame seen last.
    last: Option<u32>,
    /// Exposure time asked for, and the one taken.
    exposure: Option<(Duration, Duration)>,
    /// Frames that still have to pass after a change.
    settle: u32,
    /// Since when no frame has come from a camera that was lost, and how it went.
    away: Option<(Instant, DeviceError)>,
}

impl Worker {
    /// Until nobody can ask any more.
    pub fn run(mut self) {
        while self.take_request() {
            if self.session.is_none() {
                self.look();
            } else if let Err(error) = self.work() {
                self.lose(error);
            }
        }
    }

    /// False once the camera has been dropped.
    fn take_request(&mut self) -> bool {
        if self.state.pending.as_ref().is_some_and(|p| p.request.is_abandoned()) {
            self.state.pending = None;
        }
        let received = if self.session.is_some() || self.state.pending.is_some() {
            self.requests.try_recv()
        } else {
            self.requests.recv_timeout(LOOK_AGAIN).map_err(|e| match e {
                RecvTimeoutError::Timeout => TryRecvError::Empty,
                RecvTimeoutError::Disconnected => TryRecvError::Disconnected,
            })
        };
        match received {
            Ok(request) => {
                // a second one comes only after the first was abandoned
                let end = Instant::now() + self.options.patience;
                self.state.pending = Some(Pending { request, question: None, end, lost: 0 });
                true
            }
            Err(TryRecvError::Empty) => true,
            Err(TryRecvError::Disconnected) => false,
        }
    }

    /// Puts the question if there is one, and takes the next frame if it comes.
    fn work(&mut self) -> Result<(), DeviceError> {
        let Some(session) = &mut self.session else { return Ok(()) };
        let state = &mut self.state;
        if let Some(pending) = state.pending.as_mut().filter(|p| p.question.is_none()) {
            let wanted = pending.request.exposure;
            let taken = match state.exposure {
                Some((asked, taken)) if asked == wanted => taken,
                _ => match session.set_exposure(wanted) {
                    Ok(taken) => {
                        if state.exposure.is_none_or(|(_, before)| before != taken) {
                            state.settle = SETTLE;
                        }
                        state.exposure = Some((wanted, taken));
                        taken
                    }
                    Err(refused @ DeviceError::Refused { .. }) => {
                        self.answer(Err(refused));
                        return Ok(());
                    }
                    Err(error) => return Err(error),
                },
            };
            let question = Question {
                asked: monotonic(),
                exposure: taken,
                settle: state.settle,
                interval: session.interval,
            };
            pending.end = Instant::now() + question.patience();
            pending.question = Some(question);
        }
        let mut question = state.pending.as_mut().and_then(|p| p.question.as_mut());
        let arrived = session.next(GLANCE, |stamp| {
            let answers = question.as_mut().is_some_and(|q| q.answered_by(stamp));
            if let Some(q) = &question {
                state.settle = q.settle;
            }
            answers
        })?;
        match arrived {
            Some(frame) => {
                state.away = None;
                let lost = gap(state.last.replace(frame.sequence), frame.sequence);
                self.judge(frame.stamp, lost, frame.counts);
            }
            None => self.give_up_late(),
        }
        Ok(())
    }

    fn judge(&mut self, stamp: Duration, lost: u64, counts: Option<Result<Vec<u16>, Damage>>) {
        let damaged = matches!(counts, Some(Err(_)));
        self.count(|t| {
            t.lost += lost;
            t.damaged += u64::from(damaged);
            t.taken += u64::from(matches!(counts, Some(Ok(_))));
            t.passed += u64::from(counts.is_none());
        });
        let Some(pending) = &mut self.state.pending else { return };
        pending.lost += lost;
        match counts {
            None => {}
            Some(Err(damage)) => {
                tracing::warn!("{}: a frame is of no use: {damage}; the next is taken", self.name);
                pending.lost += 1;
            }
            Some(Ok(pixels)) => {
                let exposure = pending.question.map_or(Duration::ZERO, |q| q.exposure);
                self.state.number += pending.lost + 1;
                let frame = Frame {
                    width: self.wanted.width,
                    height: self.wanted.height,
                    pixels,
                    exposure,
                    sequence: self.state.number,
                    stamp: stamp.saturating_sub(exposure).saturating_sub(self.opened),
                    sensor_temperature_c: None,
                };
                let answer = check_depth(frame, self.wanted.bits);
                self.answer(answer);
            }
        }
    }

    /// A stream that has stopped is started anew; the one who waits is told.
    fn give_up_late(&mut self) {
        let Some(pending) = &self.state.pending else { return };
        if Instant::now() < pending.end {
            return;
        }
        let waited = pending.question.map_or(self.options.patience, |q| q.patience());
        let (device, what) = (self.name.clone(), "a frame".to_owned());
        self.answer(Err(DeviceError::Timeout { device: device.clone(), what, waited }));
        self.lose(DeviceError::Io {
            device,
            reason: "the stream has stopped and is started anew".to_owned(),
        });
    }

    fn lose(&mut self, error: DeviceError) {
        self.tell(&Notice::Lost(error.clone()));
        self.session = None;
        // one that comes back and is lost again before it has given a frame has never been back
        self.state.away.get_or_insert((Instant::now(), error));
        self.state.last = None;
        self.state.exposure = None;
        if let Some(pending) = &mut self.state.pending {
            // asked again once it is back
            pending.question = None;
        }
        self.give_up_gone(None);
    }

    /// Opens the camera again if it is there, or tells whoever waits when patience ends.
    fn look(&mut self) {
        let found = self.places.again(&self.node);
        let mut why = None;
        for node in found {
            match Session::open(&node, &self.wanted, &self.name) {
                Ok(session) => {
                    self.node = node;
                    self.session = Some(session);
                    let away = self.state.away.as_ref().map_or(Duration::ZERO, |(since, _)| since.elapsed());
                    self.tell(&Notice::Returned { away });
                    return;
                }
                Err(error) => why = Some(error),
            }
        }
        if !self.give_up_gone(why) && self.state.pending.is_some() {
            std::thread::sleep(LOOK_AGAIN);
        }
    }

    /// Tells whoever waits once patience has ended; `why` is the reason that the camera cannot be opened.
    fn give_up_gone(&mut self, why: Option<DeviceError>) -> bool {
        let Some((since, lost)) = &self.state.away else { return false };
        if self.state.pending.is_none() || since.elapsed() < self.options.patience {
            return false;
        }
        let told = matches!(why, Some(DeviceError::InUse { .. } | DeviceError::Denied { .. }));
        let gone = match lost {
            DeviceError::Gone { .. } => lost.clone(),
            _ => DeviceError::Gone { device: self.name.clone() },
        };
        self.answer(Err(why.filter(|_| told).unwrap_or(gone)));
        true
    }

    fn answer(&mut self, result: Result<Frame, DeviceError>) {
        if let Some(pending) = self.state.pending.take() {
            pending.request.answer(result);
        }
    }

    fn tell(&self, notice: &Notice) {
        match notice {
            Notice::Lost(error) => tracing::warn!("{}: {error}", self.name),
            Notice::Returned { away } => tracing::info!("{} is back after {away:.3?}", self.name),
        }
        if let Some(notices) = &self.options.notices {
            notices(notice);
        }
    }

    fn count(&self, change: impl FnOnce(&mut Tally)) {
        change(&mut self.tally.lock().unwrap_or_else(PoisonError::into_inner));
    }
}
