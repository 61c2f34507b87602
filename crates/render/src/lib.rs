//! Scenes, plots and pictures
