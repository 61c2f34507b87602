//! Meshes from files: Wavefront OBJ and glTF 2.0, told apart by content.

use std::path::Path;

use gonio_optics::Vec3;

use super::{Mesh, MeshError, MeshFinding};

/// Reads a mesh, whichever of the two formats it is in.
///
/// # Errors
/// [`MeshError`]: not readable, neither format, or broken.
pub fn read_mesh(path: &Path) -> Result<(Mesh, Vec<MeshFinding>), MeshError> {
    let bytes = std::fs::read(path)
        .map_err(|e| MeshError::Read { path: path.display().to_string(), reason: e.to_string() })?;
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(65_536)]);
    let json = text.trim_start().starts_with('{') && text.contains("\"asset\"");
    if bytes.starts_with(b"glTF") || json {
        return open_gltf(path);
    }
    let starts = |prefix: &str| text.lines().any(|l| l.trim_start().starts_with(prefix));
    if starts("v ") || starts("f ") {
        return open_obj(path);
    }
    Err(MeshError::Unknown { path: path.display().to_string() })
}

/// Reads a Wavefront OBJ; all its objects make one mesh, polygons are cut into triangles, materials are not read.
///
/// # Errors
/// [`MeshError`]: not readable or broken.
pub fn open_obj(path: &Path) -> Result<(Mesh, Vec<MeshFinding>), MeshError> {
    let refuse = |reason: String| MeshError::Read { path: path.display().to_string(), reason };
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ..tobj::LoadOptions::default() };
    let file = std::fs::File::open(path).map_err(|e| refuse(e.to_string()))?;
    let none = |_: &Path| tobj::MTLLoadResult::Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut std::io::BufReader::new(file), &options, none)
        .map_err(|e| refuse(format!("{e}; the faces are broken or name corners that do not exist")))?;
    let (mut positions, mut normals, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    for m in models {
        let first = positions.len() as u32;
        let triple = |list: &[f32]| -> Vec<Vec3> {
            list.chunks_exact(3).map(|p| Vec3::new(p[0].into(), p[1].into(), p[2].into())).collect()
        };
        positions.extend(triple(&m.mesh.positions));
        normals.extend(triple(&m.mesh.normals));
        normals.resize(positions.len(), Vec3::ZERO);
        faces.extend(m.mesh.indices.chunks_exact(3).map(|f| [f[0] + first, f[1] + first, f[2] + first]));
    }
    Mesh::new(positions, normals, &faces)
}

/// Reads a glTF: the triangles of every mesh of its first scene, placed as its nodes say.
///
/// # Errors
/// [`MeshError`]: not readable or broken.
pub fn open_gltf(path: &Path) -> Result<(Mesh, Vec<MeshFinding>), MeshError> {
    let refuse = |reason: String| MeshError::Read { path: path.display().to_string(), reason };
    let file = gltf::Gltf::open(path).map_err(|e| refuse(e.to_string()))?;
    let buffers =
        gltf::import_buffers(&file.document, path.parent(), file.blob).map_err(|e| refuse(e.to_string()))?;
    let mut parts =
        Parts { buffers: &buffers, positions: Vec::new(), normals: Vec::new(), faces: Vec::new() };
    let scene = file.document.default_scene().or_else(|| file.document.scenes().next());
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    match scene {
        Some(scene) => scene.nodes().for_each(|n| parts.node(&n, identity, 0)),
        None => file.document.meshes().for_each(|m| parts.mesh(&m, identity)),
    }
    Mesh::new(parts.positions, parts.normals, &parts.faces)
}

/// Columns of a transform.
type Matrix = [[f32; 4]; 4];

struct Parts<'a> {
    buffers: &'a [gltf::buffer::Data],
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    faces: Vec<[u32; 3]>,
}

/// Deeper trees are loops.
const DEEPEST: usize = 64;

impl Parts<'_> {
    fn node(&mut self, node: &gltf::Node<'_>, above: Matrix, depth: usize) {
        let here = product(above, node.transform().matrix());
        if let Some(mesh) = node.mesh() {
            self.mesh(&mesh, here);
        }
        if depth < DEEPEST {
            node.children().for_each(|c| self.node(&c, here, depth + 1));
        }
    }

    fn mesh(&mut self, mesh: &gltf::Mesh<'_>, m: Matrix) {
        let column = |k: usize| Vec3::new(m[k][0].into(), m[k][1].into(), m[k][2].into());
        let (x, y, z, shift) = (column(0), column(1), column(2), column(3));
        // normals turn with the cofactors, which keeps them across a surface that is stretched
        let (cx, cy, cz) = (y.cross(z), z.cross(x), x.cross(y));
        let inside_out = x.dot(cx) < 0.0;
        for primitive in mesh.primitives().filter(|p| p.mode() == gltf::mesh::Mode::Triangles) {
            let reader = primitive.reader(|b| self.buffers.get(b.index()).map(|d| &d.0[..]));
            let Some(points) = reader.read_positions() else { continue };
            let first = self.positions.len() as u32;
            self.positions.extend(points.map(|[a, b, c]| x * a.into() + y * b.into() + z * c.into() + shift));
            let count = self.positions.len() - first as usize;
            if let Some(normals) = reader.read_normals() {
                let turn = |[a, b, c]: [f32; 3]| cx * a.into() + cy * b.into() + cz * c.into();
                self.normals.extend(normals.take(count).map(turn));
            }
            self.normals.resize(self.positions.len(), Vec3::ZERO);
            let indices: Vec<u32> = match reader.read_indices() {
                Some(i) => i.into_u32().collect(),
                None => (0..count as u32).collect(),
            };
            self.faces.extend(indices.chunks_exact(3).map(|f| {
                let [a, b, c] = [f[0], f[1], f[2]].map(|i| i.saturating_add(first));
                if inside_out { [a, c, b] } else { [a, b, c] }
            }));
        }
    }
}

/// Column-major product a·b.
fn product(a: Matrix, b: Matrix) -> Matrix {
    let mut out = [[0.0; 4]; 4];
    for (column, from) in out.iter_mut().zip(b) {
        for (r, value) in column.iter_mut().enumerate() {
            *value = (0..4).map(|k| a[k][r] * from[k]).sum();
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str, text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        (dir, path)
    }

    #[test]
    fn an_obj_is_read_with_and_without_normals_and_a_broken_one_is_refused() {
        let quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
        let (_d, path) = file("quad.txt", &format!("{quad}vn 0 0 1\nf 1//1 2//1 3//1 4//1\n"));
        let (mesh, found) = read_mesh(&path).unwrap();
        assert_eq!((mesh.triangles.len(), found.len()), (2, 0));
        let (_d, path) = file("bare.obj", &format!("{quad}f 1 2 3 4\n"));
        let (_, found) = read_mesh(&path).unwrap();
        assert_eq!(found, vec![MeshFinding::NormalsMade { count: 4 }]);
        let (_d, path) = file("broken.obj", &format!("{quad}f 1 2 9\n"));
        let e = read_mesh(&path).unwrap_err().to_string();
        assert!(e.contains("broken"), "{e}");
        let (_d, path) = file("poem.txt", "the cat sat\n");
        assert!(read_mesh(&path).unwrap_err().to_string().contains("Wavefront"));
    }

    #[test]
    fn a_gltf_is_read_where_its_node_places_it() {
        // three corners as f32 and three indices as u16
        let mut bytes = Vec::new();
        for x in [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
            bytes.extend(x.to_le_bytes());
        }
        for i in [0u16, 1, 2] {
            bytes.extend(i.to_le_bytes());
        }
        let text = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"translation":[0,0,5],"scale":[2,2,2]}],
            "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
            "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],
            "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
            "buffers":[{"byteLength":42,"uri":"one.bin"}]}"#;
        let (d, path) = file("one.gltf", text);
        std::fs::write(d.path().join("one.bin"), &bytes).unwrap();
        let (mesh, found) = read_mesh(&path).unwrap();
        assert_eq!(mesh.positions[1], Vec3::new(2.0, 0.0, 5.0));
        assert_eq!(found, vec![MeshFinding::NormalsMade { count: 3 }]);
        assert!((mesh.normals[0] - Vec3::Z).norm() < 1e-9);
        let more = text.replace("\"count\":3,\"type\":\"VEC3\"", "\"count\":99,\"type\":\"VEC3\"");
        let path = d.path().join("bad.gltf");
        std::fs::write(&path, more).unwrap();
        assert!(read_mesh(&path).is_err());
    }
}
