//! Which model is fitted, by the names of `model.json`.

use std::str::FromStr;

use crate::options::{UnknownName, find};

/// Largest number of lobes a model is fitted with.
pub const MAX_LOBES: u8 = 3;

/// Which model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ModelChoice {
    /// `lambert`.
    Lambert,
    /// `ashikhmin-shirley-simplified`, Sopp (4.28).
    #[default]
    AshikhminShirleySimplified,
    /// `lambert-ashikhmin-shirley` with r0 fitted.
    LambertAshikhminShirley,
    /// `ashikhmin-shirley`, Sopp (4.17) + (4.18), r0 fitted.
    AshikhminShirley,
    /// `ashikhmin-shirley-anisotropic`: needs data with full azimuths ([`crate::Observations::from_directions`]).
    AshikhminShirleyAnisotropic,
    /// `phong`.
    Phong,
    /// `blinn-phong`.
    BlinnPhong,
    /// `ward`.
    Ward,
    /// `ward-duer`.
    WardDuer,
    /// `oren-nayar`.
    OrenNayar,
    /// `lafortune`, `lafortune:2`, `lafortune:3`: number of lobes, 1…3.
    Lafortune(u8),
    /// `cook-torrance`, `cook-torrance:2`, `cook-torrance:3`.
    CookTorrance(u8),
    /// `ggx`, `ggx:2`, `ggx:3`.
    Ggx(u8),
    /// `auto`: `ashikhmin-shirley-simplified`, or `lambert` where the data hold no lobe (its cs within two standard uncertainties of 0).
    Auto,
}

/// A clear coat over the fitted model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum CoatChoice {
    /// None.
    #[default]
    None,
    /// Of a known refractive index, above 1.
    Index(f64),
    /// Its index is fitted, within 1.05…2.5.
    Fitted,
}

impl ModelChoice {
    /// All choices with their names on the command line.
    pub const ALL: [(&'static str, Self); 20] = [
        ("lambert", Self::Lambert),
        ("phong", Self::Phong),
        ("blinn-phong", Self::BlinnPhong),
        ("ashikhmin-shirley-simplified", Self::AshikhminShirleySimplified),
        ("lambert-ashikhmin-shirley", Self::LambertAshikhminShirley),
        ("ashikhmin-shirley", Self::AshikhminShirley),
        ("ashikhmin-shirley-anisotropic", Self::AshikhminShirleyAnisotropic),
        ("ward", Self::Ward),
        ("ward-duer", Self::WardDuer),
        ("oren-nayar", Self::OrenNayar),
        ("lafortune", Self::Lafortune(1)),
        ("lafortune:2", Self::Lafortune(2)),
        ("lafortune:3", Self::Lafortune(3)),
        ("cook-torrance", Self::CookTorrance(1)),
        ("cook-torrance:2", Self::CookTorrance(2)),
        ("cook-torrance:3", Self::CookTorrance(3)),
        ("ggx", Self::Ggx(1)),
        ("ggx:2", Self::Ggx(2)),
        ("ggx:3", Self::Ggx(3)),
        ("auto", Self::Auto),
    ];

    /// Name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        let of_lobes = |one, two, three, n: u8| match n {
            0 | 1 => one,
            2 => two,
            _ => three,
        };
        match self {
            Self::Lafortune(n) => of_lobes("lafortune", "lafortune:2", "lafortune:3", n),
            Self::CookTorrance(n) => of_lobes("cook-torrance", "cook-torrance:2", "cook-torrance:3", n),
            Self::Ggx(n) => of_lobes("ggx", "ggx:2", "ggx:3", n),
            other => Self::ALL.iter().find(|(_, m)| *m == other).map_or("auto", |(name, _)| name),
        }
    }
}

impl FromStr for ModelChoice {
    type Err = UnknownName;
    fn from_str(s: &str) -> Result<Self, UnknownName> {
        find(&Self::ALL, "model", s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::Model;

    #[test]
    fn every_model_of_a_file_can_be_fitted_and_names_are_read() {
        for (name, m) in ModelChoice::ALL {
            assert_eq!((name.parse(), m.name()), (Ok(m), name));
        }
        for name in Model::NAMES {
            assert!(name.parse::<ModelChoice>().is_ok(), "{name}");
        }
        let e = "wart".parse::<ModelChoice>().unwrap_err().to_string();
        assert!(e.contains("\"wart\"") && e.contains("auto"), "{e}");
    }
}
