//! Reflectance models, one file each, and the `model.json` that names them.
//!
//! All are reciprocal, finite and not negative on θ ∈ [0°, 90°]; cosines in denominators are floored at 1e-6.

mod ashikhmin_shirley;
mod ashikhmin_shirley_anisotropic;
mod ashikhmin_shirley_simplified;
mod blinn_phong;
mod check;
mod coat;
mod cook_torrance;
mod file;
mod ggx;
pub(crate) mod half;
mod lafortune;
mod lambert;
mod lambert_ashikhmin_shirley;
#[cfg(test)]
mod laws;
mod oren_nayar;
mod over_lambert;
mod phong;
mod ward;
mod ward_duer;

pub use ashikhmin_shirley::AshikhminShirley;
pub use ashikhmin_shirley_anisotropic::AshikhminShirleyAnisotropic;
pub use ashikhmin_shirley_simplified::AshikhminShirleySimplified;
pub use blinn_phong::BlinnPhong;
pub use coat::Coat;
pub use cook_torrance::{CookTorrance, CookTorranceLobe};
pub use file::{Model, ModelError, ModelFile};
pub use ggx::{Ggx, GgxLobe};
pub use lafortune::{Lafortune, LafortuneLobe};
pub use lambert::Lambert;
pub use lambert_ashikhmin_shirley::LambertAshikhminShirley;
pub use oren_nayar::OrenNayar;
pub use phong::Phong;
pub use ward::Ward;
pub use ward_duer::WardDuer;
