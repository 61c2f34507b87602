//! One integration binary: a module per story.

mod house;
