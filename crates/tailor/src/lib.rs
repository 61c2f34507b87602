//! The trade between speed and accuracy: what each way to store a measured BRDF costs, and how far its colours are off.
//!
//! A [`Material`] is what was measured (or a model); a [`Representation`] is one way to look it up: a 3-D table, Kirchner's colour map with one of
//! his fixes, a flake map, the aspecular angle alone, a fitted model. [`trade`] builds all of them, judges each over the geometries that count,
//! times them beside each other on this machine, and tells which of them nothing else beats in both respects.
//!
//! Files, terminals and devices are not known here; neither are scenes as such: a scene is a list of weighted geometries.

mod difference;
mod findings;
mod gloss;
mod material;
mod pareto;
mod representation;
mod timing;
mod trade;

pub use difference::{ColourSpread, Difference};
pub use findings::Finding;
pub use gloss::{Gloss, GlossChoice, GlossError, GlossPeak, without_gloss};
pub use material::{Judged, Material};
pub use pareto::front;
pub use representation::{BuildError, Built, Options, Representation, Standing, UnknownRepresentation};
pub use timing::{Cost, costs};
pub use trade::{AssessError, Candidate, GeometrySet, Left, Trade, TradeError, TradeOptions, assess, trade};
