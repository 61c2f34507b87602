//! The trade between speed and accuracy: what each way to store a measured BRDF costs, and how far its colours are off.
//!
//! A [`Material`] is what was measured (or a model); a [`Representation`] is one way to look it up: a 3-D table, Kirchner's colour map with one of
//! his fixes, a flake map, the aspecular angle alone, a fitted model. [`trade`] builds all of them, judges each over the geometries that count,
//! times them beside each other on this machine, and tells which of them nothing else beats in both respects.
//!
//! [`choose`] does the same over the pixels of a scene and takes the cheapest that keeps a bound; [`plan`] asks which poses of an instrument a scene needs.
//!
//! Files, terminals and devices are not known here.

mod choice;
mod difference;
mod findings;
mod gloss;
mod material;
mod pareto;
mod pixels;
mod planning;
mod representation;
mod timing;
mod trade;

pub use choice::{Choice, ChoiceError, ChoiceOptions, SceneCandidate, Statistic, body_of, choose};
pub use difference::{ColourSpread, Difference};
pub use findings::Finding;
pub use gloss::{Gloss, GlossChoice, GlossError, GlossPeak, without_gloss};
pub use material::{Judged, Material};
pub use pareto::front;
pub use pixels::{pixel_differences, spread};
pub use planning::{
    Expected, Fill, LikelyMaterial, Next, PlanError, PlanOptions, Reach, ScenePlan, measured_with, next_pose,
    plan, reach,
};
pub use representation::{BuildError, Built, Options, Representation, Standing, UnknownRepresentation};
pub use timing::{Cost, costs};
pub use trade::{AssessError, Candidate, GeometrySet, Left, Trade, TradeError, TradeOptions, assess, trade};
