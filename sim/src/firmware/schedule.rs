//! When scheduled faults begin and end.

use super::faults::{FaultEvent, Faults, What};

#[derive(Clone, Debug)]
pub(super) struct Schedule {
    faults: Faults,
    /// Instrument time at which each event began.
    began: Vec<Option<f64>>,
}

impl Schedule {
    pub fn new(faults: Faults) -> Schedule {
        Schedule { began: vec![None; faults.events.len()], faults }
    }

    pub fn faults(&self) -> &Faults {
        &self.faults
    }

    /// Marks the events that begin now and gives them: those whose time has come, and those of move number `moves` once
    /// it is half-way.
    pub fn begin(&mut self, t: f64, moves: u32, half_way: bool) -> Vec<What> {
        let mut begun = Vec::new();
        for (event, began) in self.faults.events.iter().zip(&mut self.began) {
            let due = event.at_s.is_some_and(|at| t >= at)
                || event.at_move.is_some_and(|at| moves > at || (moves == at && half_way));
            if began.is_none() && due {
                *began = Some(event.at_s.unwrap_or(t));
                begun.push(event.what);
            }
        }
        begun
    }

    /// An event of this kind has begun and not ended, or its time has come.
    pub fn is_active(&self, what: What, t: f64) -> bool {
        let lasts = |event: &FaultEvent, began: Option<f64>| {
            began.or(event.at_s).is_some_and(|at| t >= at && event.for_s.is_none_or(|long| t < at + long))
        };
        self.faults
            .events
            .iter()
            .zip(&self.began)
            .any(|(event, began)| event.what == what && lasts(event, *began))
    }
}
