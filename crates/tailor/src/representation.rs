//! Ways to store f for look-ups: their names, how each is built from a material, and what each knows of its own limits.

use std::str::FromStr;

use gonio_brdf::maps::{
    self, Aspecular, ColourMap, FitError, FlakeFitOptions, FlakeMap, LookupTable, Region, Sample,
};
use gonio_brdf::{Brdf, ModelFile, Rgb};
use gonio_fitter::ModelChoice;
use gonio_optics::{Angle, Vec3, colour, isoline::Method};

use crate::timing::Direction;
use crate::{Finding, GlossChoice, GlossError, Material, without_gloss};

/// Light of the aspecular-only map (Kirchner's refs. 4–6: portable instruments light at 45°).
const ASPECULAR_LIGHT: Angle = Angle::from_degrees(45.0);
/// Largest K.
const MOST_HARMONICS: usize = 3;
/// Fewer measurements than this are taken for those of a portable multi-angle instrument.
const HANDFUL: usize = 30;
/// Half angle of the cone about the mirror direction in which such an instrument sees gloss.
const HANDFUL_CONE: Angle = Angle::from_degrees(10.0);
/// Fewer measurements than this are called sparse.
const SPARSE: usize = 100;

/// One way to store f.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Representation {
    /// Three dimensions, trilinear.
    Table,
    /// Kirchner's colour map with a rule for the critical angle.
    ColourMap(Method),
    /// Flake map of K harmonics.
    FlakeMap(usize),
    /// The aspecular angle alone.
    Aspecular,
    /// A fitted model.
    Model(ModelChoice),
}

/// A name that is no representation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown representation \"{found}\": use table, clip, map-vector, map-vector-parallel, unit-index, flake-map:K with K of 0 to 3, or aspecular"
)]
pub struct UnknownRepresentation {
    /// The name given.
    pub found: String,
}

impl Representation {
    /// Every one that can be built without a fit of a model.
    pub const MAPS: [Self; 10] = [
        Self::Table,
        Self::Aspecular,
        Self::ColourMap(Method::UnitIndex),
        Self::ColourMap(Method::Clip),
        Self::ColourMap(Method::MapVector),
        Self::ColourMap(Method::MapVectorParallel),
        Self::FlakeMap(0),
        Self::FlakeMap(1),
        Self::FlakeMap(2),
        Self::FlakeMap(3),
    ];

    /// Every one, the fitter's models included.
    pub fn all() -> impl Iterator<Item = Self> {
        let models = ModelChoice::ALL.into_iter().map(|(_, m)| m).filter(|m| *m != ModelChoice::Auto);
        Self::MAPS.into_iter().chain(models.map(Self::Model))
    }
}

impl std::fmt::Display for Representation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Table => f.write_str("table"),
            Self::ColourMap(m) => f.write_str(m.name()),
            Self::FlakeMap(k) => write!(f, "flake-map:{k}"),
            Self::Aspecular => f.write_str("aspecular"),
            Self::Model(m) => {
                f.write_str(ModelChoice::ALL.iter().find(|a| a.1 == *m).map_or("model", |a| a.0))
            }
        }
    }
}

impl FromStr for Representation {
    type Err = UnknownRepresentation;
    fn from_str(s: &str) -> Result<Self, UnknownRepresentation> {
        let unknown = || UnknownRepresentation { found: s.to_owned() };
        match s {
            "table" => Ok(Self::Table),
            "aspecular" => Ok(Self::Aspecular),
            _ => match s.strip_prefix("flake-map:") {
                Some(k) => {
                    k.parse().ok().filter(|k| *k <= MOST_HARMONICS).map(Self::FlakeMap).ok_or_else(unknown)
                }
                None => s.parse().map(Self::ColourMap).map_err(|_| unknown()),
            },
        }
    }
}

/// How representations are built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Refractive index of the coat, 1 for none.
    pub index: f64,
    /// Geometries that maps hold: steeper ones are taken at this angle by colour maps and continued by flake maps.
    pub largest: Angle,
    /// Nodes of a colour map along each angle.
    pub nodes: usize,
    /// Nodes of the trilinear table over θi, θo, φ.
    pub table: [usize; 3],
    /// What happens to the gloss before a colour map is drawn.
    pub gloss: GlossChoice,
}

impl Options {
    /// For a coat of `index`: to 75°, 64 nodes, Sopp's 19 × 37 × 36.
    #[must_use]
    pub const fn new(index: f64) -> Self {
        Self {
            index,
            largest: Angle::from_degrees(75.0),
            nodes: 64,
            table: [19, 37, 36],
            gloss: GlossChoice::Auto,
        }
    }

    /// The geometries that flake maps are fitted to.
    #[must_use]
    pub fn region(&self) -> Region {
        Region { largest: self.largest, ..Region::default() }
    }

    fn flake(&self, harmonics: usize) -> FlakeFitOptions {
        FlakeFitOptions { index: self.index, harmonics, region: self.region(), ..FlakeFitOptions::default() }
    }
}

/// A representation that cannot be built from a material.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// It needs f between measurements.
    #[error(
        "{representation} needs values between the measurements, and scattered geometries have none: use flake-map:K, or fit a model first"
    )]
    Scattered {
        /// Which.
        representation: String,
    },
    /// Nothing in the plane of incidence.
    #[error(
        "no in-plane measurement (φ = 0° or 180°) within {largest_deg}° and more than {mirror_deg}° from the mirror direction: a colour map is made of these; \
         measure some, or use flake-map:K"
    )]
    NoInPlane {
        /// Limit of the polar angles, degrees.
        largest_deg: f64,
        /// Cone left out, degrees.
        mirror_deg: f64,
    },
    /// Harmonics that the data cannot determine.
    #[error(
        "all {count} measurements lie in the plane of incidence, which leaves harmonics undetermined: use flake-map:0, or measure other azimuths too"
    )]
    AllInPlane {
        /// Measurements.
        count: usize,
    },
    /// A flake map that is asked to become another one.
    #[error("flake maps of {asked} harmonics cannot be made from a map of {has}: go back to the measurement")]
    FewerHarmonics {
        /// K asked for.
        asked: usize,
        /// K there is.
        has: usize,
    },
    /// The fit of a flake map.
    #[error(transparent)]
    Flake(#[from] FitError),
    /// Gloss.
    #[error(transparent)]
    Gloss(#[from] GlossError),
    /// The fit of a model.
    #[error("{model} could not be fitted: {status}")]
    Model {
        /// Which.
        model: String,
        /// Status of the fit.
        status: String,
    },
}

/// How an answer stands to what was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// Data stood around it.
    Supported,
    /// The critical angle was met, so the method's rule decided.
    CriticalAngle,
    /// Steeper than the map reaches: the value at its edge, or a continuation.
    BeyondLargest,
    /// Nothing was measured near: a smooth continuation.
    NothingNear,
    /// Within the cone about the mirror direction that a flake map leaves out: its answer has no gloss.
    Gloss,
}

impl From<maps::Standing> for Standing {
    fn from(s: maps::Standing) -> Self {
        match s {
            maps::Standing::Measured => Self::Supported,
            maps::Standing::Continued => Self::NothingNear,
            maps::Standing::Gloss => Self::Gloss,
            maps::Standing::BeyondLargest | maps::Standing::BelowHorizon => Self::BeyondLargest,
        }
    }
}

impl Standing {
    /// As the column `flag` of measured files says it: 0 measured, 2 extrapolated.
    #[must_use]
    pub const fn flag(self) -> u8 {
        if matches!(self, Self::Supported) { 0 } else { 2 }
    }
}

/// A representation built from a material.
pub struct Built {
    /// Which.
    pub representation: Representation,
    /// What to know about it.
    pub findings: Vec<Finding>,
    evaluator: Evaluator,
    largest: Angle,
}

enum Evaluator {
    Table(LookupTable),
    Colour(ColourMap),
    Flake(FlakeMap),
    Aspecular(Aspecular),
    Model(Box<ModelFile>, usize),
}

impl Representation {
    /// Builds it.
    ///
    /// # Errors
    /// [`BuildError`]: what the material lacks for it, and what to use instead.
    pub fn build(self, material: &Material, options: &Options) -> Result<Built, BuildError> {
        let mut findings = Vec::new();
        let evaluator = match self {
            Self::Table => {
                let brdf = material
                    .brdf()
                    .ok_or_else(|| BuildError::Scattered { representation: self.to_string() })?;
                Evaluator::Table(LookupTable::from_brdf(brdf, options.table))
            }
            Self::ColourMap(method) => {
                let make = |f: &dyn Brdf| {
                    ColourMap::from_brdf(f, options.index, method, options.largest, options.nodes)
                };
                Evaluator::Colour(with_in_plane(material, options, &mut findings, make)?)
            }
            Self::Aspecular => {
                let make = |f: &dyn Brdf| Aspecular::from_brdf(f, ASPECULAR_LIGHT, options.largest);
                Evaluator::Aspecular(with_in_plane(material, options, &mut findings, make)?)
            }
            Self::FlakeMap(harmonics) => {
                Evaluator::Flake(flake_map(material, options, harmonics, &mut findings)?)
            }
            Self::Model(choice) => model(material, options, choice, &self.to_string())?,
        };
        Ok(Built { representation: self, findings, evaluator, largest: options.largest })
    }
}

/// The samples that count for a map, with what is to say about them.
fn samples(material: &Material, options: &Options, findings: &mut Vec<Finding>) -> Vec<Sample> {
    let samples = material.samples(options.region());
    if (1..SPARSE).contains(&samples.len()) {
        findings.push(Finding::Sparse { count: samples.len() });
    }
    samples
}

fn flake_map(
    material: &Material,
    options: &Options,
    harmonics: usize,
    findings: &mut Vec<Finding>,
) -> Result<FlakeMap, BuildError> {
    if let Some(map) = material.flake_map() {
        // the map in the file is what was measured; a smaller one can be fitted to it, a larger one would be made up
        if map.harmonics() == harmonics {
            return Ok(map.clone());
        }
        if map.harmonics() < harmonics {
            return Err(BuildError::FewerHarmonics { asked: harmonics, has: map.harmonics() });
        }
    }
    let few = material.scattered().filter(|s| s.points.len() < HANDFUL);
    let samples = match few {
        Some(points) => handful_region(options).of_scattered(points),
        None => samples(material, options, findings),
    };
    if !samples.is_empty() && samples.iter().all(is_in_plane) {
        if harmonics > 0 {
            return Err(BuildError::AllInPlane { count: samples.len() });
        }
        findings.push(Finding::AllInPlane { count: samples.len() });
    }
    if harmonics == 0
        && let Some(map) = handful(material, options)?
    {
        findings.extend(map.findings().iter().cloned().map(Finding::Map));
        return Ok(map);
    }
    let wanted = options.flake(harmonics);
    // cells of a table are met by means over them, points at themselves
    let map = match material.table() {
        Some(table) => FlakeMap::fit_table(&material.name, table, &wanted)?,
        None => FlakeMap::fit(&material.name, &samples, &wanted)?,
    };
    // whoever states a coat knows better than what the measurements seem to say
    let stated = material.stated_index().is_some_and(|n| n > 1.0);
    let told = map.findings().iter().filter(|f| !(stated && matches!(f, maps::Finding::CoatNotSeen { .. })));
    findings.extend(told.cloned().map(Finding::Map));
    Ok(map)
}

/// Portable instruments measure at 15° from the mirror direction, which maps of full data leave out.
fn handful_region(options: &Options) -> Region {
    Region { largest: options.largest, from_mirror: HANDFUL_CONE }
}

/// The estimate from a portable instrument's few geometries, with its uncertainty; `None` for materials with more than a handful.
fn handful(material: &Material, options: &Options) -> Result<Option<FlakeMap>, BuildError> {
    let Some(points) = material.scattered().filter(|s| s.points.len() < HANDFUL) else { return Ok(None) };
    let region = handful_region(options);
    let samples = region.of_scattered(points);
    if samples.len() < 3 {
        return Err(BuildError::Flake(FitError::Data {
            found: samples.len(),
            expected: 3,
            largest_deg: region.largest.degrees().round(),
            mirror_deg: region.from_mirror.degrees().round(),
        }));
    }
    Ok(Some(FlakeMap::from_multi_angle(&material.name, &samples, options.index)?))
}

/// Whether light, view and normal lie in one plane, to half a degree of azimuth.
fn is_in_plane(s: &Sample) -> bool {
    let flat = |d: Vec3| d.x.hypot(d.y);
    let cross = (s.light.x * s.view.y - s.light.y * s.view.x).abs();
    cross <= Angle::from_degrees(0.5).sin() * (flat(s.light) * flat(s.view)).max(1e-12)
}

/// Makes something from f in the plane of incidence without gloss. Of scattered measurements those in the plane are joined by a smooth surface in
/// flake space, where the in-plane geometries of light and view exchanged are one place; of a handful the surface is an estimate.
fn with_in_plane<T>(
    material: &Material,
    options: &Options,
    findings: &mut Vec<Finding>,
    make: impl Fn(&dyn Brdf) -> T,
) -> Result<T, BuildError> {
    if material.brdf().is_some() {
        let (body, _) = without_gloss(material, options.index, options.gloss)?;
        return Ok(make(&*body));
    }
    if let Some(map) = handful(material, options)? {
        findings.extend(map.findings().iter().cloned().map(Finding::Map));
        return Ok(make(&map));
    }
    let region = options.region();
    let in_plane: Vec<Sample> = material.samples(region).into_iter().filter(is_in_plane).collect();
    if in_plane.is_empty() {
        return Err(BuildError::NoInPlane {
            largest_deg: region.largest.degrees(),
            mirror_deg: region.from_mirror.degrees(),
        });
    }
    if in_plane.len() < SPARSE {
        findings.push(Finding::Sparse { count: in_plane.len() });
    }
    let surface = FlakeMap::fit(&material.name, &in_plane, &options.flake(0))?;
    Ok(make(&surface))
}

fn model(
    material: &Material,
    options: &Options,
    choice: ModelChoice,
    name: &str,
) -> Result<Evaluator, BuildError> {
    let fail = |status: &str| BuildError::Model { model: name.to_owned(), status: status.to_owned() };
    let observations = material.observations().ok_or_else(|| fail("there is nothing to fit it to"))?;
    let wanted = gonio_fitter::Options {
        model: choice,
        max_angle: options.largest,
        ..gonio_fitter::Options::default()
    };
    let fit = gonio_fitter::fit(&observations, &wanted);
    if matches!(fit.status.name(), "no-data" | "non-finite") {
        return Err(fail(fit.status.name()));
    }
    Ok(Evaluator::Model(Box::new(fit.to_model_file()), 4 * fit.parameters.len()))
}

impl Built {
    /// f in 1/sr of unit directions.
    #[must_use]
    pub fn eval(&self, light: Vec3, view: Vec3) -> Rgb {
        self.brdf().eval(light, view)
    }

    /// The representation as a function.
    #[must_use]
    pub fn brdf(&self) -> &dyn Brdf {
        match &self.evaluator {
            Evaluator::Table(t) => t,
            Evaluator::Colour(m) => m,
            Evaluator::Flake(m) => m,
            Evaluator::Aspecular(a) => a,
            Evaluator::Model(m, _) => m.as_ref(),
        }
    }

    /// The flake map, if it is one.
    #[must_use]
    pub fn flake_map(&self) -> Option<&FlakeMap> {
        if let Evaluator::Flake(m) = &self.evaluator { Some(m) } else { None }
    }

    /// Relative standard uncertainty of the luminance over the region of the maps by solid angle, median and 95th percentile; `None` where the
    /// representation states none.
    #[must_use]
    pub fn relative_sigma(&self) -> Option<[f64; 2]> {
        let map = self.flake_map().filter(|m| m.has_sigma())?;
        let at = |(l, v): (Vec3, Vec3)| {
            let y = colour::luminance(map.eval(l, v));
            map.sigma(l, v).map(|s| colour::luminance(s) / y).filter(|r| r.is_finite())
        };
        let mut all: Vec<f64> = map.region().directions(1000, 2).filter_map(at).collect();
        all.sort_by(f64::total_cmp);
        let pick = |q: usize| all.get(all.len() * q / 100).copied();
        Some([pick(50)?, pick(95)?])
    }

    /// The colour map, if it is one.
    #[must_use]
    pub fn colour_map(&self) -> Option<&ColourMap> {
        if let Evaluator::Colour(m) = &self.evaluator { Some(m) } else { None }
    }

    /// How the answer for a geometry stands to what was measured.
    #[must_use]
    pub fn standing(&self, light: Vec3, view: Vec3) -> Standing {
        let low = self.largest.cos() - 1e-9;
        let steep = light.z < low || view.z < low;
        match &self.evaluator {
            Evaluator::Colour(m) => {
                if m.equivalent(light, view).limited {
                    return Standing::CriticalAngle;
                }
            }
            Evaluator::Flake(m) => return m.standing(light, view).into(),
            Evaluator::Table(_) | Evaluator::Aspecular(_) | Evaluator::Model(..) => {}
        }
        if steep && !matches!(self.evaluator, Evaluator::Table(_)) {
            Standing::BeyondLargest
        } else {
            Standing::Supported
        }
    }

    /// Bytes that a look-up reads from: three channels of 32 bits; of a model its parameters.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match &self.evaluator {
            Evaluator::Table(t) => t.bytes(),
            Evaluator::Colour(m) => m.bytes(),
            Evaluator::Flake(m) => m.bytes(),
            Evaluator::Aspecular(a) => a.bytes(),
            Evaluator::Model(_, bytes) => *bytes,
        }
    }

    /// The arithmetic of [`Self::eval_many`].
    #[must_use]
    pub const fn arithmetic(&self) -> &'static str {
        match &self.evaluator {
            Evaluator::Table(_) => "f32, one at a time",
            Evaluator::Flake(_) => "f32, many at a time",
            Evaluator::Colour(_) | Evaluator::Aspecular(_) | Evaluator::Model(..) => "f64, one at a time",
        }
    }

    /// f of many geometries by the fastest path there is; ends with the shortest slice.
    pub fn eval_many(&self, lights: &[Direction], views: &[Direction], out: &mut [[f32; 3]]) {
        let each = |out: &mut [[f32; 3]], f: &dyn Brdf| {
            for ((l, v), o) in lights.iter().zip(views).zip(out) {
                *o = f.eval(double(*l), double(*v)).map(|x| x as f32);
            }
        };
        match &self.evaluator {
            Evaluator::Table(t) => {
                for ((l, v), o) in lights.iter().zip(views).zip(out) {
                    *o = t.eval_single(*l, *v);
                }
            }
            Evaluator::Flake(m) => m.eval_many(lights, views, out),
            Evaluator::Colour(m) => each(out, m),
            Evaluator::Aspecular(a) => each(out, a),
            Evaluator::Model(m, _) => each(out, m.as_ref()),
        }
    }
}

fn double(d: Direction) -> Vec3 {
    let [x, y, z] = d.map(f64::from);
    Vec3::new(x, y, z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonio_brdf::formats::Loaded;
    use gonio_brdf::{Flag, Scattered, ScatteredPoint};
    use gonio_optics::Geometry;

    const PAINT: &str = r#"{"model":"ggx","diffuse":[0.05,0.1,0.3],"lobes":[{"specular":[0.3,0.2,0.1],"alpha":0.3,"r0":0.5}],"coat":{"index":1.5}}"#;

    fn paint() -> Material {
        Material::new("paint", Loaded::Model(Box::new(ModelFile::from_json(PAINT).unwrap())))
    }

    fn scattered(phi: &[f64]) -> Material {
        let paint = paint();
        let mut points = Vec::new();
        for i in 0..8 {
            for o in 0..8 {
                for &p in phi {
                    let geometry = Geometry::from_degrees(10.0 * f64::from(i), 10.0 * f64::from(o), p);
                    let (l, v) = geometry.directions();
                    let value = paint.brdf().unwrap().eval(l, v);
                    points.push(ScatteredPoint { geometry, value, sigma: None, flag: Flag::Measured });
                }
            }
        }
        Material::new("points", Loaded::Scattered(Scattered { points }))
    }

    #[test]
    fn names_are_read_back_and_wrong_ones_answered() {
        for r in Representation::MAPS {
            assert_eq!(r.to_string().parse::<Representation>().unwrap(), r);
        }
        for wrong in ["flake-map", "flake-map:4", "flake-map:x", "photo"] {
            let e = wrong.parse::<Representation>().unwrap_err().to_string();
            assert!(e.contains(wrong) && e.contains("map-vector-parallel"), "{e}");
        }
        assert!(Representation::all().count() > Representation::MAPS.len());
    }

    #[test]
    fn many_at_a_time_is_the_same_as_one_at_a_time() {
        let m = paint();
        let pairs: Vec<_> = Region::default().directions(37, 5).collect();
        let single = |d: Vec3| d.to_array().map(|x| x as f32);
        let (lights, views): (Vec<_>, Vec<_>) = pairs.iter().map(|&(l, v)| (single(l), single(v))).unzip();
        for r in [
            Representation::Table,
            Representation::Aspecular,
            Representation::ColourMap(Method::Clip),
            Representation::FlakeMap(1),
        ] {
            let built = r.build(&m, &Options::new(1.5)).unwrap();
            let mut out = vec![[0.0; 3]; pairs.len()];
            built.eval_many(&lights, &views, &mut out);
            for (o, (l, v)) in out.iter().zip(&pairs) {
                let one = built.eval(*l, *v);
                assert!(
                    (0..3).all(|c| (f64::from(o[c]) - one[c]).abs() <= 1e-4 * one[c] + 1e-6),
                    "{r}: {o:?} {one:?}"
                );
            }
            assert!(built.bytes() > 0 && built.findings.is_empty());
        }
    }

    #[test]
    fn what_a_map_does_not_know_is_told() {
        let at = |b: &Built, g: (f64, f64, f64)| {
            let (l, v) = Geometry::from_degrees(g.0, g.1, g.2).directions();
            b.standing(l, v)
        };
        let clip = Representation::ColourMap(Method::Clip).build(&paint(), &Options::new(1.5)).unwrap();
        assert_eq!(at(&clip, (20.0, 40.0, 0.0)), Standing::Supported);
        assert_eq!(at(&clip, (75.0, 75.0, 110.0)), Standing::CriticalAngle);
        assert_eq!(at(&clip, (85.0, 10.0, 180.0)), Standing::BeyondLargest);
        let few = scattered(&[0.0]);
        let flake = Representation::FlakeMap(0).build(&few, &Options::new(1.5)).unwrap();
        assert_eq!(at(&flake, (60.0, 30.0, 180.0)), Standing::NothingNear);
        assert_eq!(Standing::NothingNear.flag(), 2);
        assert!(
            flake.findings.iter().any(|f| matches!(f, Finding::AllInPlane { count: 61..=64 })),
            "{:?}",
            flake.findings
        );
    }

    #[test]
    fn a_portable_instruments_eight_angles_give_an_estimate_with_its_uncertainty() {
        let paint = paint();
        let at = |geometry: Geometry| {
            let (l, v) = geometry.directions();
            let value = paint.brdf().unwrap().eval(l, v);
            ScatteredPoint { geometry, value, sigma: None, flag: Flag::Measured }
        };
        let points: Vec<_> = maps::multi_angle::portable_geometries().map(at).to_vec();
        let m = Material::new("portable", Loaded::Scattered(Scattered { points: points.clone() }));
        let map = Representation::FlakeMap(0).build(&m, &Options::new(1.5)).unwrap();
        let [median, p95] = map.relative_sigma().unwrap();
        assert!(median > 0.01 && p95 >= median && p95 < 3.0, "{median} {p95}");
        assert!(map.findings.iter().any(|f| f.name() == "estimated"), "{:?}", map.findings);
        for p in &points {
            let (l, v) = p.geometry.directions();
            assert!((map.eval(l, v)[1] / p.value[1] - 1.0).abs() < 0.25, "{:?}", p.geometry);
        }
        // most of what was not measured lies within twice the uncertainty
        let region = map.flake_map().unwrap().region();
        let pairs: Vec<_> = region.directions(400, 1).collect();
        let held = pairs
            .iter()
            .filter(|(l, v)| {
                let s = map.flake_map().unwrap().sigma(*l, *v).unwrap()[1];
                (map.eval(*l, *v)[1] - paint.brdf().unwrap().eval(*l, *v)[1]).abs() <= 2.0 * s
            })
            .count();
        assert!(held > 300, "{held} of 400");
        assert!(Representation::FlakeMap(1).build(&m, &Options::new(1.5)).is_err());
        let clip = Representation::ColourMap(Method::Clip).build(&m, &Options::new(1.5)).unwrap();
        assert!(clip.findings.iter().any(|f| f.name() == "estimated"));
        let few = Material::new("two", Loaded::Scattered(Scattered { points: points[1..3].to_vec() }));
        let e = Representation::FlakeMap(0).build(&few, &Options::new(1.5)).err().unwrap().to_string();
        assert!(e.contains("2 measured geometries"), "{e}");
    }

    #[test]
    fn in_plane_measurements_make_a_colour_map_and_no_harmonics() {
        let in_plane = scattered(&[0.0, 180.0]);
        let clip = Representation::ColourMap(Method::Clip).build(&in_plane, &Options::new(1.5)).unwrap();
        let (l, v) = Geometry::from_degrees(50.0, 20.0, 180.0).directions();
        let (is, want) = (clip.eval(l, v), paint().brdf().unwrap().eval(l, v));
        assert!((is[1] / want[1] - 1.0).abs() < 0.1, "{is:?} {want:?}");
        let e = Representation::FlakeMap(1).build(&in_plane, &Options::new(1.5)).err().unwrap();
        assert!(e.to_string().contains("flake-map:0"), "{e}");
        let e = Representation::Table.build(&in_plane, &Options::new(1.5)).err().unwrap();
        assert!(e.to_string().contains("table"), "{e}");
        let out_of_plane = scattered(&[60.0, 90.0]);
        let none = Material::new(
            "n",
            Loaded::Scattered(Scattered {
                points: out_of_plane
                    .scattered()
                    .unwrap()
                    .points
                    .iter()
                    .copied()
                    .filter(|p| p.geometry.theta_i.degrees() > 1.0 && p.geometry.theta_o.degrees() > 1.0)
                    .collect(),
            }),
        );
        let e = Representation::Aspecular.build(&none, &Options::new(1.5)).err().unwrap();
        assert!(e.to_string().contains("in-plane"), "{e}");
    }
}
