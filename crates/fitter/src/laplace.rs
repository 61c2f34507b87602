//! The fast way to the sums of [`crate::moments`], for lobes that are exponentials of their exponent or of 1/α² ([`kernel`]).
//!
//! Such a lobe is a Laplace transform of where the data lie: f_i(x) = g(x) Σ_j a_ij e_j(x), e_j(x) the coefficients of e^(−x u) over the bins of
//! [`axis`] and a_ij what cell i holds there ([`measure`]). So every sum over the data is a product of e(x) with sums that do not depend on x: A^T W y, one pass over the
//! data per fit, and A^T W A and A^T W d, which do not even depend on the values. The search then never sees the data again, however many
//! exponents it tries, and a mean over a cell costs what a node costs.

pub(crate) mod axis;
mod cells;
pub(crate) mod kernel;
pub(crate) mod measure;
mod problem;
mod search;
mod sums;

pub(crate) use problem::Transformed;
