//! One integration binary: a module per story.

mod formats;
mod house;
mod real_data;
mod two_optics_agree;
mod wire;
