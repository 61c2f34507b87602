//! Fits of reflectance models to measured BRDFs, without starting values.
//!
//! Every model here is linear in its colours and nonlinear in a few parameters: widths, a reflectance at normal incidence, the index of a coat. The colours
//! are solved per channel inside, none below 0 (variable projection), every nonlinear parameter is tried over its whole range, and the best places are refined
//! by Levenberg–Marquardt with exact derivatives. The model is averaged over cells and lamp exactly as the data say
//! ([`gonio_brdf::average`]). Every fit ends with a [`Status`], the covariance of its parameters, a condition number, errors, colour
//! differences and a residual for each cell. No data make it panic.
//!
//! ```
//! use gonio_brdf::{Grid, Measured, models::AshikhminShirleySimplified};
//! use gonio_fitter::{Observations, Options, fit};
//!
//! let truth = AshikhminShirleySimplified { diffuse: [0.2; 3], specular: [0.1; 3], exponent: 120.0 };
//! let table = Measured::sampled(Grid::sopp(), &truth);
//! let result = fit(&Observations::from_measured(&table), &Options::default());
//! assert!((result.parameter("exponent").unwrap().value / 120.0 - 1.0).abs() < 1e-4);
//! ```
//!
//! Left to others: files, devices, what a cell is ([`gonio_brdf`]), pictures of the residuals.

pub mod anneal;
mod assess;
pub mod auto;
mod choice;
mod coat_index;
mod colour_error;
mod direct;
mod family;
mod fit;
mod joint;
mod laplace;
mod moments;
mod names;
mod nodes;
mod nonnegative;
mod notes;
mod number;
mod observations;
mod options;
mod prepared;
mod ray;
mod refine;
mod report;
mod reweight;
mod rows;
mod solve;
pub mod sopp;
mod start;
mod status;
mod term;
mod uncertainty;
mod voronoi;

pub use assess::{Assessment, assess, assess_brdf, colours_at};
pub use choice::{CoatChoice, MAX_LOBES, ModelChoice};
pub use colour_error::{ColourErrors, Spread};
pub use fit::{Fit, Parameter, fit};
pub use observations::Observations;
pub use options::{Loss, Options, UnknownName, Weights};
pub use prepared::{Minimum, Prepared};
pub use status::{Reason, Status};
