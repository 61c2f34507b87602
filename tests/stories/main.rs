//! One integration binary: a module per story.

mod house;
mod two_optics_agree;
mod wire;
