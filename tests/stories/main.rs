//! One integration binary: a module per story.

mod bad_input;
mod coat;
mod command;
mod effect_coatings;
mod faulty_line;
mod fitting;
mod flake_shaders;
mod formats;
mod geometry;
mod going_on;
mod golden_tables;
mod hardware;
mod house;
mod laws;
mod main_job;
mod mixing;
mod real_data;
mod reliability;
mod renderers;
mod scenes;
mod shaders;
mod textures;
mod two_optics_agree;
mod wire;
