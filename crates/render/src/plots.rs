//! Plots of measured tables and of what was fitted to them, one kind a file.
//!
//! Every function takes tables and options and returns a [`Picture`](crate::Picture): nothing is written, nothing is
//! random, and the same input gives the same pixels.

mod axis;
pub mod budget_bars;
pub(crate) mod cells;
pub mod chart;
mod colorbar;
pub mod colour_map;
pub mod compare;
pub mod coverage;
pub mod flake_map;
mod legend;
pub mod lobe;
pub mod pareto;
mod polar;
pub mod scene_geometries;
pub mod scene_pair;
pub mod sensor_map;
pub mod sigma;
pub mod spots;
mod strip;
pub mod unfolded;

pub use budget_bars::BudgetBars;
pub use cells::model_table;
pub use chart::{Chart, ChartPoint};
pub use colour_map::ColourMapPlot;
pub use compare::{Compare, Difference, compare, compare_tables};
pub use coverage::coverage;
pub use flake_map::FlakeMapPlot;
pub use lobe::{Channel, Curve, Lobe, lobe};
pub use pareto::{Pareto, ParetoPoint};
pub use scene_geometries::scene_geometries;
pub use scene_pair::SceneRow;
pub use sensor_map::SensorMap;
pub use sigma::sigma;
pub use spots::{SpotMark, SpotPlot};
pub use unfolded::{Unfolded, brightening, unfolded};

pub(crate) use axis::{Scale, short, step_up as nice_above};
pub(crate) use cells::{folded, quantile, relative_sigma, value};
pub(crate) use colorbar::ColourBar;
pub(crate) use legend::hatch as hatch_at;
pub(crate) use unfolded::title;
