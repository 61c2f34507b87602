//! What a flake paint is made of, as a TOML file.
//!
//! ```toml
//! format = "gonio-flake-paint"
//! version = 1
//! name = "silver"
//! seed = 1
//! coat_index = 1.5
//! diffuse = [0.01, 0.01, 0.012]      # what lies under the flakes
//! absorption_per_mm = [0.0, 0.0, 0.0] # of the coat over them
//! tile_mm = 4.0                       # the tile of flakes repeats
//! texel_mm = 0.02                     # resolution of the texture camera
//!
//! [[flakes]]
//! density_per_mm2 = 400.0
//! size_mm = 0.025                     # median diameter
//! size_spread = 0.4                   # standard deviation of its logarithm
//! spread_deg = 9.0                    # standard deviation of the slope along either axis, as an angle
//! life_deg = 6.5                      # half angles over which it is brighter than half, inside the coat
//! depth_mm = [0.002, 0.03]            # below the surface
//! reflectance = [0.85, 0.86, 0.88]
//! film_nm = 0.0                       # thickness of an interference film; 0 for bare metal
//! film_spread_nm = 0.0
//! film_index = 2.4
//! ```

use serde::{Deserialize, Serialize};

const FORMAT: &str = "gonio-flake-paint";
/// Most flakes in a tile.
const MOST_FLAKES: f64 = 4e6;

/// A paint with flakes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlakePaint {
    /// Always `gonio-flake-paint`.
    pub format: String,
    /// Version of the format, 1.
    pub version: u32,
    /// Name for people.
    #[serde(default)]
    pub name: String,
    /// Seed of all places and tilts.
    #[serde(default)]
    pub seed: u64,
    /// Refractive index of the clear coat.
    pub coat_index: f64,
    /// Albedo of what lies under the flakes, per channel.
    pub diffuse: [f64; 3],
    /// Absorption of the coat over the flakes, 1/mm per channel.
    #[serde(default)]
    pub absorption_per_mm: [f64; 3],
    /// Side of the tile of flakes, mm.
    #[serde(default = "tile")]
    pub tile_mm: f64,
    /// Side of a texel, mm.
    #[serde(default = "texel")]
    pub texel_mm: f64,
    /// Kinds of flakes.
    pub flakes: Vec<Population>,
}

/// One kind of flakes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Population {
    /// Number on a square millimetre.
    pub density_per_mm2: f64,
    /// Median diameter, mm.
    pub size_mm: f64,
    /// Standard deviation of the diameter's logarithm.
    #[serde(default)]
    pub size_spread: f64,
    /// Standard deviation of the slope along either axis, as an angle in degrees.
    pub spread_deg: f64,
    /// Half angles inside the coat over which a flake is brighter than half, degrees.
    #[serde(default = "life")]
    pub life_deg: f64,
    /// Smallest and largest depth below the surface, mm.
    pub depth_mm: [f64; 2],
    /// Reflectance per channel; of a film, a factor on its own.
    pub reflectance: [f64; 3],
    /// Mean thickness of the interference film, nm; 0 for none.
    #[serde(default)]
    pub film_nm: f64,
    /// Standard deviation of the thickness from flake to flake, nm.
    #[serde(default)]
    pub film_spread_nm: f64,
    /// Refractive index of the film (2.4: titanium dioxide on mica).
    #[serde(default = "film_index")]
    pub film_index: f64,
}

fn tile() -> f64 {
    4.0
}
fn texel() -> f64 {
    0.02
}
fn life() -> f64 {
    6.5
}
fn film_index() -> f64 {
    2.4
}

/// A description that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FlakePaintError {
    /// Not TOML, or not its keys.
    #[error("flake paint cannot be read: {0}")]
    Syntax(String),
    /// A value outside its bounds.
    #[error("flake paint: {key} = {found}, expected {expected}")]
    Value {
        /// The key.
        key: String,
        /// What is there.
        found: String,
        /// What would be accepted.
        expected: &'static str,
    },
}

impl FlakePaint {
    /// Whether a text says that it is a flake paint.
    #[must_use]
    pub fn is_one(text: &str) -> bool {
        text.lines().any(|l| {
            let (key, value) = l.split_once('=').unwrap_or_default();
            key.trim() == "format" && value.contains(FORMAT)
        })
    }

    /// Reads and checks a description.
    ///
    /// # Errors
    /// [`FlakePaintError`] with the key, what was found and what would be accepted.
    pub fn from_toml(text: &str) -> Result<Self, FlakePaintError> {
        let p: Self = toml::from_str(text).map_err(|e| FlakePaintError::Syntax(e.to_string()))?;
        p.check()?;
        Ok(p)
    }

    /// Checks every value against its bounds.
    ///
    /// # Errors
    /// [`FlakePaintError::Value`] with the first outside them.
    pub fn check(&self) -> Result<(), FlakePaintError> {
        let value = |key: String, found: &dyn std::fmt::Display, expected| FlakePaintError::Value {
            key,
            found: found.to_string(),
            expected,
        };
        let within = |key: &str, v: f64, low: f64, high: f64, expected| {
            if (low..=high).contains(&v) { Ok(()) } else { Err(value(key.to_owned(), &v, expected)) }
        };
        if self.format != FORMAT {
            return Err(value("format".to_owned(), &self.format, "gonio-flake-paint"));
        }
        if self.version != 1 {
            return Err(value("version".to_owned(), &self.version, "1, the version this program reads"));
        }
        within("coat_index", self.coat_index, 1.2, 2.5, "1.2 … 2.5 (1.5 for clear coats)")?;
        for v in self.diffuse {
            within("diffuse", v, 0.0, 1.0, "albedos within 0 … 1")?;
        }
        for v in self.absorption_per_mm {
            within("absorption_per_mm", v, 0.0, 1e4, "0 … 10000 per mm")?;
        }
        within("tile_mm", self.tile_mm, 0.1, 50.0, "0.1 … 50 mm")?;
        within("texel_mm", self.texel_mm, 0.001, 1.0, "0.001 … 1 mm")?;
        if self.tile_mm / self.texel_mm > 8192.0 {
            return Err(value("texel_mm".to_owned(), &self.texel_mm, "at most 8192 texels along the tile"));
        }
        let mut flakes = 0.0;
        for (k, p) in self.flakes.iter().enumerate() {
            let key = |name: &str| format!("flakes[{k}].{name}");
            within(&key("density_per_mm2"), p.density_per_mm2, 0.0, 1e5, "0 … 100000 per mm²")?;
            within(&key("size_mm"), p.size_mm, 0.001, 0.5, "0.001 … 0.5 mm")?;
            within(&key("size_spread"), p.size_spread, 0.0, 1.5, "0 … 1.5")?;
            within(&key("spread_deg"), p.spread_deg, 0.0, 45.0, "0 … 45 degrees")?;
            within(&key("life_deg"), p.life_deg, 0.5, 40.0, "0.5 … 40 degrees (6 to 7 for real flakes)")?;
            for v in p.reflectance {
                within(&key("reflectance"), v, 0.0, 1.0, "factors within 0 … 1")?;
            }
            within(&key("film_nm"), p.film_nm, 0.0, 2000.0, "0 … 2000 nm")?;
            within(&key("film_spread_nm"), p.film_spread_nm, 0.0, 500.0, "0 … 500 nm")?;
            within(&key("film_index"), p.film_index, 1.3, 3.5, "1.3 … 3.5")?;
            let [low, high] = p.depth_mm;
            if !(low >= 0.0 && high >= low && high <= 1.0) {
                return Err(value(
                    key("depth_mm"),
                    &format!("[{low}, {high}]"),
                    "[least, most] within 0 … 1 mm",
                ));
            }
            flakes += p.density_per_mm2 * self.tile_mm * self.tile_mm;
        }
        if flakes > MOST_FLAKES {
            return Err(value(
                "tile_mm".to_owned(),
                &self.tile_mm,
                "at most 4 million flakes in a tile: make it smaller",
            ));
        }
        Ok(())
    }
}
