//! What a ray meets: an exact sphere, or a mesh under a tree.
//!
//! The tree (obvhs, a compressed eight-way one) is in single precision, the faces under it in double.

use glam::Vec3A;
use gonio_optics::Vec3;
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;

use crate::mesh::Mesh;

/// A place on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray.
    pub distance: f64,
    /// The place.
    pub position: Vec3,
    /// Unit normal of the face, towards where the ray came from.
    pub geometric: Vec3,
    /// Unit normal as the surface is meant to be, on the same side.
    pub normal: Vec3,
}

/// The object of a scene.
pub struct Body {
    kind: Kind,
}

enum Kind {
    Sphere { centre: Vec3, radius: f64 },
    Mesh(Box<Tree>),
}

struct Tree {
    mesh: Mesh,
    bvh: CwBvh,
    /// In the order of the tree's leaves.
    triangles: Vec<[Vec3; 3]>,
    /// Triangle of the mesh for each.
    places: Vec<u32>,
    centre: Vec3,
    radius: f64,
}

impl std::fmt::Debug for Body {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (centre, radius) = self.ball();
        write!(f, "Body({} triangles, centre {centre:?}, radius {radius})", self.triangles())
    }
}

impl Body {
    /// An exact sphere.
    #[must_use]
    pub const fn sphere(centre: Vec3, radius: f64) -> Self {
        Self { kind: Kind::Sphere { centre, radius } }
    }

    /// A checked mesh.
    #[must_use]
    pub fn mesh(mesh: Mesh) -> Self {
        let (low, high) = mesh.bounds();
        let (centre, radius) = ((low + high) * 0.5, 0.5 * (high - low).norm());
        let all: Vec<Triangle> = mesh
            .triangles
            .iter()
            .map(|t| {
                let [v0, v1, v2] = t.map(|i| single(mesh.positions[i as usize]));
                Triangle { v0, v1, v2 }
            })
            .collect();
        let bvh =
            build_cwbvh_from_tris(&all, BvhBuildParams::medium_build(), &mut std::time::Duration::default());
        let places = bvh.primitive_indices.clone();
        let corners = |t: [u32; 3]| t.map(|i| mesh.positions[i as usize]);
        let triangles = places.iter().map(|&i| corners(mesh.triangles[i as usize])).collect();
        Self { kind: Kind::Mesh(Box::new(Tree { mesh, bvh, triangles, places, centre, radius })) }
    }

    /// Triangles; 0 for a sphere.
    #[must_use]
    pub fn triangles(&self) -> usize {
        match &self.kind {
            Kind::Sphere { .. } => 0,
            Kind::Mesh(t) => t.mesh.triangles.len(),
        }
    }

    /// Middle and radius of a ball that holds it.
    #[must_use]
    pub fn ball(&self) -> (Vec3, f64) {
        match &self.kind {
            Kind::Sphere { centre, radius } => (*centre, *radius),
            Kind::Mesh(t) => (t.centre, t.radius),
        }
    }

    /// How far off the surface a ray starts so that it does not meet the face it leaves.
    #[must_use]
    pub fn step_off(&self) -> f64 {
        match &self.kind {
            Kind::Sphere { radius, .. } => 1e-9 * radius,
            Kind::Mesh(t) => 2e-5 * t.radius,
        }
    }

    /// The nearest place that a ray meets.
    #[must_use]
    pub fn hit(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        match &self.kind {
            Kind::Sphere { centre, radius } => {
                let distance = sphere(origin - *centre, direction, *radius)?;
                let position = origin + direction * distance;
                let outwards = (position - *centre).normalized();
                let normal = if outwards.dot(direction) > 0.0 { -outwards } else { outwards };
                Some(Hit { distance, position, geometric: normal, normal })
            }
            Kind::Mesh(t) => t.hit(origin, direction),
        }
    }

    /// Whether something lies on the ray before `distance`.
    #[must_use]
    pub fn blocks(&self, origin: Vec3, direction: Vec3, distance: f64) -> bool {
        match &self.kind {
            Kind::Sphere { centre, radius } => {
                sphere(origin - *centre, direction, *radius).is_some_and(|d| d < distance)
            }
            Kind::Mesh(t) => {
                let ray = Ray::new(single(origin), single(direction), 0.0, distance as f32);
                !t.bvh.ray_traverse_miss(ray, |_, id| meet(&t.triangles[id], origin, direction) as f32)
            }
        }
    }
}

/// First distance above 0 at which a ray meets a sphere about the origin.
fn sphere(from: Vec3, direction: Vec3, radius: f64) -> Option<f64> {
    let b = from.dot(direction);
    // the squared distance of the ray from the middle, without the cancellation of b² − c
    let off = (from - direction * b).norm_squared();
    let d2 = radius * radius - off;
    if d2 < 0.0 {
        return None;
    }
    let d = d2.sqrt();
    [-b - d, -b + d].into_iter().find(|t| *t > 0.0)
}

impl Tree {
    fn hit(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        let ray = Ray::new_inf(single(origin), single(direction));
        let mut found = RayHit::none();
        if !self
            .bvh
            .ray_traverse(ray, &mut found, |_, id| meet(&self.triangles[id], origin, direction) as f32)
        {
            return None;
        }
        let corners = *self.mesh.triangles.get(*self.places.get(found.primitive_id as usize)? as usize)?;
        let [a, b, c] = corners.map(|i| self.mesh.positions[i as usize]);
        let (e1, e2) = (b - a, c - a);
        let across = e1.cross(e2);
        let det = across.dot(direction);
        if det == 0.0 {
            return None;
        }
        let from = origin - a;
        let distance = -from.dot(across) / det;
        let turned = from.cross(direction);
        // barycentric weights of the second and third corner, kept on the face against rounding
        let u = (-e2.dot(turned) / det).clamp(0.0, 1.0);
        let v = (e1.dot(turned) / det).clamp(0.0, 1.0 - u);
        let position = a + e1 * u + e2 * v;
        let [na, nb, nc] = corners.map(|i| self.mesh.normals[i as usize]);
        let meant = (na * (1.0 - u - v) + nb * u + nc * v).normalized();
        let face = across.normalized();
        let geometric = if face.dot(direction) > 0.0 { -face } else { face };
        let normal = if meant.dot(geometric) < 0.0 { -meant } else { meant };
        Some(Hit { distance, position, geometric, normal })
    }
}

/// Barycentric weights may fall this far below 0: rays between two faces must not slip through the rounding.
const SEAM: f64 = 1e-9;

/// Distance at which a ray meets a triangle from either side (Möller and Trumbore 1997), infinite where it does not. In double precision: thin faces
/// far from the camera would leave gaps else.
fn meet([a, b, c]: &[Vec3; 3], origin: Vec3, direction: Vec3) -> f64 {
    let (e1, e2) = (*b - *a, *c - *a);
    let p = direction.cross(e2);
    let inverse = 1.0 / e1.dot(p);
    let from = origin - *a;
    let u = from.dot(p) * inverse;
    let q = from.cross(e1);
    let v = direction.dot(q) * inverse;
    let distance = e2.dot(q) * inverse;
    // a face seen edge-on gives no number, and no hit
    let inside = u >= -SEAM && v >= -SEAM && u + v <= 1.0 + SEAM;
    if inside && distance >= 0.0 { distance } else { f64::INFINITY }
}

/// Adding 0 turns −0 into 0: the tree takes the side of a direction from its sign, and a minus zero from both sides at once.
fn single(v: Vec3) -> Vec3A {
    Vec3A::new(v.x as f32 + 0.0, v.y as f32 + 0.0, v.z as f32 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh;
    use crate::scene::sphere_of_directions;

    #[test]
    fn rays_meet_a_finely_cut_body_where_its_surface_is() {
        let capsule = Body::mesh(mesh::capsule());
        let (mut missed, mut worst) = (Vec::new(), 0.0f64);
        for d in sphere_of_directions(2000) {
            // towards the axis from outside
            let from = d * 5.0;
            let Some(h) = capsule.hit(from, -d) else {
                missed.push(d);
                continue;
            };
            let p = h.position;
            let off_axis = Vec3::new(p.x, (p.y.abs() - 0.5).max(0.0), p.z).norm();
            worst = worst.max((off_axis - 0.5).abs());
            assert!((from - d * h.distance - p).norm() < 1e-5, "{h:?}");
            let expected = Vec3::new(p.x, p.y.signum() * (p.y.abs() - 0.5).max(0.0), p.z).normalized();
            assert!(h.normal.dot(expected) > 0.9995, "{h:?} {expected:?}");
            assert!(capsule.blocks(from, -d, 10.0) && !capsule.blocks(from, d, 10.0));
            assert!(!capsule.blocks(from, -d, h.distance - 1e-3));
        }
        assert!(missed.is_empty(), "{missed:?}");
        assert!(worst < 3e-4, "{worst}");
    }

    #[test]
    fn the_tree_finds_what_trying_every_triangle_finds() {
        let pot = mesh::teapot(6);
        let body = Body::mesh(pot.clone());
        let mut differ = 0;
        for (k, d) in sphere_of_directions(400).enumerate() {
            let from = d * 6.0;
            let aim = Vec3::new(((k * 7) % 13) as f64 / 13.0 - 0.5, ((k * 5) % 11) as f64 / 11.0 - 0.5, 0.1);
            let direction = (aim - from).normalized();
            let brute = pot
                .triangles
                .iter()
                .filter_map(|t| {
                    let t = meet(&t.map(|i| pot.positions[i as usize]), from, direction);
                    t.is_finite().then_some(t)
                })
                .fold(f64::INFINITY, f64::min);
            let found = body.hit(from, direction).map_or(f64::INFINITY, |h| h.distance);
            differ += usize::from((brute.is_finite() || found.is_finite()) && (brute - found).abs() > 1e-3);
        }
        assert_eq!(differ, 0);
    }
}
