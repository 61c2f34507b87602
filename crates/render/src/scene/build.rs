//! From the keys of a scene file to a scene: values checked, meshes and maps read, every view laid out.

use std::path::Path;

use gonio_optics::{Angle, Rotation, Vec3};

use super::file::{CameraKeys, LightKeys, ObjectKeys, Shape};
use super::{Camera, Scene, SceneError, SceneFile, View, steps};
use crate::light::{Environment, Lamp};
use crate::mesh::{self, Mesh, MeshFinding};
use crate::trace::Body;

/// Pieces along the side of a patch of the teapot.
const TEAPOT_CUTS: usize = 24;
/// Most views of one scene.
const MOST_VIEWS: usize = 1000;

impl Scene {
    /// Reads a scene file and what it names, which lies beside it.
    ///
    /// # Errors
    /// [`SceneError`].
    pub fn open(path: &Path) -> Result<Self, SceneError> {
        let shown = path.display().to_string();
        let text = std::fs::read_to_string(path)
            .map_err(|source| SceneError::Read { path: shown.clone(), source })?;
        let file = SceneFile::from_toml(&text, &shown)?;
        let mut scene = Self::build(&file, path.parent().unwrap_or(Path::new(".")))?;
        if scene.name.is_empty() {
            scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        }
        Ok(scene)
    }

    /// Lays a scene out; files are looked for in `folder`.
    ///
    /// # Errors
    /// [`SceneError`]: a value that cannot be, a mesh or a map that cannot be used.
    pub fn build(file: &SceneFile, folder: &Path) -> Result<Self, SceneError> {
        if file.size.iter().any(|n| !(1..=16_384).contains(n)) {
            return Err(SceneError::value("size", file.size, "1 to 16384 pixels a side"));
        }
        if !(1..=65_536).contains(&file.samples) {
            return Err(SceneError::value("samples", file.samples, "1 to 65536"));
        }
        if let Some(e) = file.exposure.filter(|e| !(e.is_finite() && *e > 0.0)) {
            return Err(SceneError::value("exposure", e, "a number above 0"));
        }
        if file.lights.is_empty() {
            return Err(SceneError::value("light", "none", "at least one [[light]]"));
        }
        let lamps =
            file.lights.iter().enumerate().map(|(k, l)| lamp(k, l, folder)).collect::<Result<Vec<_>, _>>()?;
        let (body, findings) = body(&file.object, folder)?;
        let camera = camera(&file.camera)?;
        let turns = |key: &str, range: &Option<super::file::Range>| match range {
            None => Ok(vec![Angle::ZERO]),
            Some(r) if r.steps >= 1 && r.from_deg.is_finite() && r.to_deg.is_finite() => {
                Ok(steps(r.from_deg, r.to_deg, r.steps))
            }
            Some(r) => Err(SceneError::value(key, r, "finite from_deg and to_deg, at least one step")),
        };
        let orbit = turns("camera.orbit", &file.camera.orbit)?;
        let table = turns("object.turntable", &file.object.turntable)?;
        if orbit.len() * table.len() > MOST_VIEWS {
            return Err(SceneError::value("steps", orbit.len() * table.len(), "at most 1000 views in all"));
        }
        let target = Vec3::from(file.camera.to);
        let mut views = Vec::new();
        for &turn in &table {
            for &place in &orbit {
                let seen = camera.turned(target, place).turned(Vec3::ZERO, -turn);
                views.push(View { camera: seen, lamps: lamps.iter().map(|l| l.turned_back(turn)).collect() });
            }
        }
        Ok(Self {
            name: file.name.clone(),
            size: file.size,
            samples: file.samples,
            exposure: file.exposure,
            body,
            views,
            findings,
            show_environment: file.show_environment,
        })
    }
}

fn finite(key: &str, v: [f64; 3]) -> Result<Vec3, SceneError> {
    if v.iter().all(|x| x.is_finite()) {
        Ok(Vec3::from(v))
    } else {
        Err(SceneError::value(key, v, "three finite numbers"))
    }
}

fn camera(keys: &CameraKeys) -> Result<Camera, SceneError> {
    let (from, to, up) =
        (finite("camera.from", keys.from)?, finite("camera.to", keys.to)?, finite("camera.up", keys.up)?);
    let forwards = (to - from).normalized();
    let right = forwards.cross(up);
    if (to - from).norm() < 1e-9 || right.norm() < 1e-9 * up.norm().max(1e-9) {
        return Err(SceneError::value(
            "camera",
            (keys.from, keys.to, keys.up),
            "from and to apart, and up not along the line between them",
        ));
    }
    let right = right.normalized();
    let (half_height, parallel) = match (keys.field_of_view_deg, keys.height) {
        (Some(_), Some(_)) => {
            return Err(SceneError::value(
                "camera.height",
                keys.height,
                "either height (parallel rays) or field_of_view_deg",
            ));
        }
        (None, Some(h)) if h.is_finite() && h > 0.0 => (0.5 * h, true),
        (None, Some(h)) => return Err(SceneError::value("camera.height", h, "a length above 0")),
        (fov, None) => {
            let deg = fov.unwrap_or(30.0);
            if !(deg > 0.0 && deg < 170.0) {
                return Err(SceneError::value("camera.field_of_view_deg", deg, "above 0, below 170 degrees"));
            }
            (Angle::from_degrees(0.5 * deg).tan(), false)
        }
    };
    Ok(Camera { from, axes: [right, right.cross(forwards), forwards], half_height, parallel })
}

fn lamp(k: usize, keys: &LightKeys, folder: &Path) -> Result<Lamp, SceneError> {
    let key = |name: &str| format!("light[{k}].{name}");
    let light = |name: &str, v: [f64; 3]| {
        if v.iter().all(|x| x.is_finite() && *x >= 0.0) {
            Ok(v)
        } else {
            Err(SceneError::value(key(name), v, "three numbers of 0 and more"))
        }
    };
    match keys {
        LightKeys::Directional { towards, irradiance, half_angle_deg } => {
            let d = finite(&key("towards"), *towards)?;
            if d.norm() < 1e-9 {
                return Err(SceneError::value(key("towards"), towards, "a direction, not zero"));
            }
            if !(0.0..30.0).contains(half_angle_deg) {
                return Err(SceneError::value(key("half_angle_deg"), half_angle_deg, "0 to 30 degrees"));
            }
            Ok(Lamp::Directional {
                towards: d.normalized(),
                irradiance: light("irradiance", *irradiance)?,
                half_angle: Angle::from_degrees(*half_angle_deg),
            })
        }
        LightKeys::Point { position, intensity, radius } => {
            if !(radius.is_finite() && *radius >= 0.0) {
                return Err(SceneError::value(key("radius"), radius, "0 or more"));
            }
            Ok(Lamp::Point {
                position: finite(&key("position"), *position)?,
                intensity: light("intensity", *intensity)?,
                radius: *radius,
            })
        }
        LightKeys::Environment { file, sky, radiance, turn_deg } => {
            let factor = light("radiance", *radiance)?;
            let map = match (file, sky) {
                (Some(name), None) => {
                    let path = folder.join(name);
                    Environment::open(&path, factor).map_err(|reason| SceneError::Environment {
                        path: path.display().to_string(),
                        reason,
                    })?
                }
                (None, Some(sky)) => Environment::sky(*sky, factor),
                _ => {
                    return Err(SceneError::value(
                        key("file"),
                        file,
                        "either file = \"map.exr\" or sky = \"uniform\", \"overcast\" or \"studio\"",
                    ));
                }
            };
            if !turn_deg.is_finite() {
                return Err(SceneError::value(key("turn_deg"), turn_deg, "finite degrees"));
            }
            Ok(Lamp::Environment(map.turned(Angle::from_degrees(*turn_deg))))
        }
    }
}

fn body(keys: &ObjectKeys, folder: &Path) -> Result<(Body, Vec<MeshFinding>), SceneError> {
    if !(keys.scale.is_finite() && keys.scale > 0.0) {
        return Err(SceneError::value("object.scale", keys.scale, "above 0"));
    }
    let shift = finite("object.shift", keys.shift)?;
    finite("object.turn_deg", [keys.turn_deg, keys.tip_deg, 0.0])?;
    let turn = Rotation::about_axis(Vec3::Y, Angle::from_degrees(keys.turn_deg))
        .after(Rotation::about_axis(Vec3::X, Angle::from_degrees(keys.tip_deg)));
    let mut findings = Vec::new();
    let mesh = match (&keys.shape, &keys.mesh) {
        (Some(Shape::Sphere), None) => return Ok((Body::sphere(shift, keys.scale), findings)),
        (Some(Shape::Egg), None) => mesh::egg(),
        (Some(Shape::Capsule), None) => mesh::capsule(),
        (Some(Shape::Teapot), None) => mesh::teapot(TEAPOT_CUTS),
        (Some(Shape::Car), None) => mesh::car(),
        (None, Some(name)) => {
            let (mesh, found) = mesh::read_mesh(&folder.join(name))?;
            findings = found;
            mesh
        }
        _ => {
            return Err(SceneError::value(
                "object",
                (&keys.shape, &keys.mesh),
                "either shape (sphere, egg, capsule, teapot, car) or mesh = \"file\"",
            ));
        }
    };
    let mesh = if keys.fit { fitted(mesh) } else { mesh };
    let scale = keys.scale;
    let mesh = mesh.moved(|p| turn.apply(p * scale) + shift, |n| turn.apply(n));
    Ok((Body::mesh(mesh), findings))
}

fn fitted(mesh: Mesh) -> Mesh {
    let (low, high) = mesh.bounds();
    let middle = (low + high) * 0.5;
    let half = (high - low) * 0.5;
    let largest = half.x.max(half.y).max(half.z).max(1e-12);
    mesh.moved(|p| (p - middle) * (1.0 / largest), |n| n)
}
