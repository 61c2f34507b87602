//! The device's memory of commands, so that a repeated one is answered and not executed again.
//!
//! Ids rise with each new command of a client. The last `N` commands are remembered with their latest reply; an
//! unknown id that is not above all known ones has been forgotten and must not be executed.

use crate::message::Reply;

/// What is known about a command id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// Never heard: execute it.
    New,
    /// Heard before; this was the latest reply: repeat it, do nothing else.
    Before(Reply),
    /// Too old to know: reject it.
    Forgotten,
}

/// Memory for the last `N` commands of one client.
#[derive(Clone, Debug)]
pub struct Dedup<const N: usize> {
    entries: [Option<(u32, Reply)>; N],
    next: usize,
    highest: Option<u32>,
}

impl<const N: usize> Default for Dedup<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Dedup<N> {
    /// An empty memory.
    pub const fn new() -> Self {
        Dedup { entries: [None; N], next: 0, highest: None }
    }

    /// Forgets everything: another client has come.
    pub fn clear(&mut self) {
        *self = Self::new();
    }

    /// Looks `id` up and, if it is new, remembers it as accepted.
    pub fn begin(&mut self, id: u32) -> Seen {
        if let Some((_, reply)) = self.entries.iter().flatten().find(|(known, _)| *known == id) {
            return Seen::Before(*reply);
        }
        if self.highest.is_some_and(|highest| id <= highest) {
            return Seen::Forgotten;
        }
        if let Some(entry) = self.entries.get_mut(self.next) {
            *entry = Some((id, Reply::Accepted));
        }
        self.next = (self.next + 1) % N.max(1);
        self.highest = Some(id);
        Seen::New
    }

    /// Remembers the latest reply to `id`.
    pub fn record(&mut self, id: u32, reply: Reply) {
        if let Some((_, known)) = self.entries.iter_mut().flatten().find(|(known, _)| *known == id) {
            *known = reply;
        }
    }
}
