//! How a text is set.

use super::font::Weight;
use crate::picture::Srgb;

/// Which point of the text lies at the position given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// Size, weight, colour and place of one line of text.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Text {
    /// Size of the em in points.
    pub size: f64,
    pub weight: Weight,
    pub colour: Srgb,
    /// Along the line.
    pub along: Anchor,
    /// Across it: `Start` hangs below the position, `Middle` is centred on capitals, `End` stands on it.
    pub across: Anchor,
    /// Quarter turns clockwise; 3 reads upwards.
    pub turn: u8,
}

impl Text {
    pub(crate) const fn new(size: f64, colour: Srgb) -> Self {
        Self { size, weight: Weight::Regular, colour, along: Anchor::Start, across: Anchor::Middle, turn: 0 }
    }

    pub(crate) const fn bold(self) -> Self {
        Self { weight: Weight::Bold, ..self }
    }

    pub(crate) const fn at(self, along: Anchor, across: Anchor) -> Self {
        Self { along, across, ..self }
    }

    pub(crate) const fn upwards(self) -> Self {
        Self { turn: 3, ..self }
    }
}
