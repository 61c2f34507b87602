//! The shutter: closed by a spring, opened against it, both in the same time.

/// A shutter with a travel time. A command that waits for its end is kept here.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shutter {
    travel_s: f64,
    open: bool,
    until: Option<f64>,
    /// Command answered at the end of the travel.
    pub id: Option<u32>,
}

impl Shutter {
    pub fn new(travel_s: f64) -> Shutter {
        Shutter { travel_s, open: false, until: None, id: None }
    }

    /// Begins to travel, unless it stands there or is on its way there.
    pub fn set(&mut self, t: f64, open: bool) {
        if self.open != open {
            self.open = open;
            self.until = Some(t + self.travel_s);
        }
    }

    /// True once, at the end of a travel.
    pub fn advance(&mut self, t: f64) -> bool {
        let ended = self.until.is_some_and(|until| t >= until);
        if ended {
            self.until = None;
        }
        ended
    }

    pub fn is_travelling(&self) -> bool {
        self.until.is_some()
    }

    pub fn ends_at(&self) -> Option<f64> {
        self.until
    }

    /// Fully open.
    pub fn lets_light_through(&self) -> bool {
        self.open && self.until.is_none()
    }

    /// Fully closed.
    pub fn is_closed(&self) -> bool {
        !self.open && self.until.is_none()
    }

    /// Open, or on its way there.
    pub fn is_opening_or_open(&self) -> bool {
        self.open
    }
}
