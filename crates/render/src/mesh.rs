//! Triangle meshes: what an object of a scene is made of when it is not a sphere.
//!
//! A mesh is checked once: indices in range, positions finite, faces with an area, a unit normal at every corner. Where the file has no normals they
//! are made from the faces, and that is said. y is up; lengths are the scene's own.

mod car;
mod read;
mod revolved;
mod teapot;

use gonio_optics::Vec3;

pub use car::car;
pub use read::{open_gltf, open_obj, read_mesh};
pub use revolved::{capsule, egg};
pub use teapot::teapot;

/// A checked mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Corners.
    pub positions: Vec<Vec3>,
    /// Unit normal at each corner.
    pub normals: Vec<Vec3>,
    /// Corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Something done to a mesh that its author should know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MeshFinding {
    /// The file has no normals, or some that are not usable.
    NormalsMade {
        /// Corners concerned.
        count: usize,
    },
    /// Faces without an area.
    Degenerate {
        /// How many were left out.
        count: usize,
        /// Of how many.
        of: usize,
    },
}

impl std::fmt::Display for MeshFinding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NormalsMade { count } => write!(
                f,
                "{count} corners have no normal: made from the faces around them, which rounds edges that are meant to be sharp; export the mesh with normals \
                 to keep them"
            ),
            Self::Degenerate { count, of } => {
                write!(f, "{count} of {of} faces have no area and are left out")
            }
        }
    }
}

/// A mesh that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// No such file, or not readable.
    #[error("{path} cannot be read: {reason}")]
    Read {
        /// The file.
        path: String,
        /// What the system or the parser said.
        reason: String,
    },
    /// Neither format.
    #[error(
        "{path} is no mesh that is known: expected Wavefront OBJ (lines \"v x y z\", \"f a b c\") or glTF 2.0 (.gltf, .glb)"
    )]
    Unknown {
        /// The file.
        path: String,
    },
    /// Nothing in it.
    #[error(
        "the mesh has no triangle with an area ({faces} faces, {corners} corners): nothing to render; check the export"
    )]
    Empty {
        /// Faces in the file.
        faces: usize,
        /// Corners in the file.
        corners: usize,
    },
    /// A face that names a corner that is not there.
    #[error(
        "face {face} names corner {found}, the mesh has {corners}: the faces are broken; export the mesh again"
    )]
    Index {
        /// Number of the face, from 0.
        face: usize,
        /// The corner named.
        found: u32,
        /// Corners there are.
        corners: usize,
    },
    /// A position that is no number.
    #[error("corner {corner} stands at {found:?}, expected three finite numbers; export the mesh again")]
    Position {
        /// Number of the corner, from 0.
        corner: usize,
        /// What the file says.
        found: [f64; 3],
    },
}

impl Mesh {
    /// Checks corners and faces; makes normals where `normals` is shorter than the corners or holds some that are no directions.
    ///
    /// # Errors
    /// [`MeshError`]: a broken face or corner, or nothing to see.
    pub fn new(
        positions: Vec<Vec3>,
        mut normals: Vec<Vec3>,
        faces: &[[u32; 3]],
    ) -> Result<(Self, Vec<MeshFinding>), MeshError> {
        let corners = positions.len();
        if let Some((corner, p)) = positions
            .iter()
            .enumerate()
            .find(|(_, p)| !p.to_array().iter().all(|x| x.is_finite() && x.abs() < 1e12))
        {
            return Err(MeshError::Position { corner, found: p.to_array() });
        }
        for (face, indices) in faces.iter().enumerate() {
            if let Some(&found) = indices.iter().find(|&&i| i as usize >= corners) {
                return Err(MeshError::Index { face, found, corners });
            }
        }
        let cross = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| positions[i as usize]);
            (b - a).cross(c - a)
        };
        let triangles: Vec<[u32; 3]> =
            faces.iter().filter(|t| cross(t).norm_squared() > 0.0).copied().collect();
        if triangles.is_empty() {
            return Err(MeshError::Empty { faces: faces.len(), corners });
        }
        let mut findings = Vec::new();
        if triangles.len() < faces.len() {
            findings.push(MeshFinding::Degenerate { count: faces.len() - triangles.len(), of: faces.len() });
        }
        normals.resize(corners, Vec3::ZERO);
        let mut used = vec![false; corners];
        triangles.iter().flatten().for_each(|&i| used[i as usize] = true);
        let usable = |n: &Vec3| n.norm().is_finite() && n.norm() > 1e-6;
        let missing = normals.iter().zip(&used).filter(|(n, used)| **used && !usable(n)).count();
        if missing > 0 {
            findings.push(MeshFinding::NormalsMade { count: missing });
            let mut made = vec![Vec3::ZERO; corners];
            for t in &triangles {
                // the cross product weights a face by its area
                let n = cross(t);
                t.iter().for_each(|&i| made[i as usize] = made[i as usize] + n);
            }
            for (n, m) in normals.iter_mut().zip(made) {
                if !usable(n) {
                    *n = m;
                }
            }
        }
        // opposite faces may cancel: any direction is better than none
        let normals =
            normals.into_iter().map(|n| if usable(&n) { n.normalized() } else { Vec3::Z }).collect();
        Ok((Self { positions, normals, triangles }, findings))
    }

    /// The same mesh moved: every position by `point`, every normal by `direction` (a rotation).
    #[must_use]
    pub fn moved(mut self, point: impl Fn(Vec3) -> Vec3, direction: impl Fn(Vec3) -> Vec3) -> Self {
        self.positions.iter_mut().for_each(|p| *p = point(*p));
        self.normals.iter_mut().for_each(|n| *n = direction(*n).normalized());
        self
    }

    /// Lowest and highest corner of the box around it.
    #[must_use]
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let mut low = Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY);
        let mut high = -low;
        for p in &self.positions {
            low = Vec3::new(low.x.min(p.x), low.y.min(p.y), low.z.min(p.z));
            high = Vec3::new(high.x.max(p.x), high.y.max(p.y), high.z.max(p.z));
        }
        (low, high)
    }
}

/// A net of `columns` × `rows` points as two triangles a mesh; `around` joins the last column to the first. Outside lies on the right of the rows.
pub(crate) fn net(columns: usize, rows: usize, around: bool) -> Vec<[u32; 3]> {
    let mut out = Vec::new();
    for c in 0..if around { columns } else { columns.saturating_sub(1) } {
        for r in 0..rows.saturating_sub(1) {
            let at = |c: usize, r: usize| ((c % columns) * rows + r) as u32;
            out.push([at(c, r), at(c, r + 1), at(c + 1, r)]);
            out.push([at(c + 1, r), at(c, r + 1), at(c + 1, r + 1)]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: positive where faces look outwards and leave no hole.
    fn volume(m: &Mesh) -> f64 {
        m.triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| m.positions[i as usize]);
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    }

    #[test]
    fn shapes_are_closed_look_outwards_and_have_normals_along_their_faces() {
        let ball = 4.0 / 3.0 * std::f64::consts::PI;
        let capsule = capsule();
        // half spheres of radius ½ at the ends of a cylinder of length 1
        let expected = ball * 0.125 + std::f64::consts::PI * 0.25;
        assert!((volume(&capsule) / expected - 1.0).abs() < 2e-3, "{} {expected}", volume(&capsule));
        for (name, mesh) in [("egg", egg()), ("capsule", capsule), ("teapot", teapot(8)), ("car", car())] {
            assert!(volume(&mesh) > 0.0, "{name} {}", volume(&mesh));
            let mut against = 0;
            for t in &mesh.triangles {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                let n = (b - a).cross(c - a).normalized();
                against += usize::from(t.iter().any(|&i| n.dot(mesh.normals[i as usize]) < 0.0));
            }
            assert!(against * 200 < mesh.triangles.len(), "{name}: {against} of {}", mesh.triangles.len());
        }
    }

    #[test]
    fn broken_meshes_say_what_is_broken() {
        let square = || vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X + Vec3::Y];
        let e = Mesh::new(square(), vec![], &[[0, 1, 7]]).unwrap_err().to_string();
        assert!(e.contains("corner 7") && e.contains("has 4"), "{e}");
        assert!(Mesh::new(square(), vec![], &[[0, 0, 1]]).unwrap_err().to_string().contains("no triangle"));
        let nan = vec![Vec3::new(f64::NAN, 0.0, 0.0), Vec3::X, Vec3::Y];
        assert!(Mesh::new(nan, vec![], &[[0, 1, 2]]).unwrap_err().to_string().contains("corner 0"));
        let (mesh, found) = Mesh::new(square(), vec![], &[[0, 1, 2], [1, 1, 2], [2, 1, 3]]).unwrap();
        assert_eq!(found[0], MeshFinding::Degenerate { count: 1, of: 3 });
        assert_eq!(found[1], MeshFinding::NormalsMade { count: 4 });
        assert!(mesh.normals.iter().all(|n| (*n - Vec3::Z).norm() < 1e-12));
    }
}
