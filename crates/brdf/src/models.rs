//! Reflectance models, one file each, and the `model.json` that names them.

mod ashikhmin_shirley_simplified;
mod coat;
mod file;
mod lambert;

pub use ashikhmin_shirley_simplified::AshikhminShirleySimplified;
pub use coat::Coat;
pub use file::{Model, ModelError, ModelFile};
pub use lambert::Lambert;
