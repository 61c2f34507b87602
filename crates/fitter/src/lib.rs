//! Fits of reflectance models to measured BRDFs, without starting values.
//!
//! The Ashikhmin–Shirley models are linear in cd and cs and nonlinear in the exponent (and r0) alone. So cd and cs are solved per
//! channel inside (variable projection, bounded at 0), and what is left is a search over the logarithm of the exponent: a coarse grid
//! brackets the global minimum, Brent's method refines it. The model is averaged over cells and lamp exactly as the data say
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
mod cache;
mod colour_error;
mod fit;
mod linear;
mod observations;
mod options;
mod problem;
mod report;
mod search;
pub mod sopp;
mod uncertainty;
mod voronoi;

pub use colour_error::{ColourErrors, Spread};
pub use fit::{Fit, Parameter, Status, fit};
pub use observations::Observations;
pub use options::{ModelChoice, Options, UnknownName, Weights};
