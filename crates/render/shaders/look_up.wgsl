// Look-ups of gonio's two maps for renderers: copy this file, fill the two headers and the two buffers, call gonio_flake_map or gonio_colour_map.
//
// Directions are unit vectors in the frame of the surface, z along the normal, both pointing away from it. What comes back is f in 1/sr, linear
// Rec. 709 RGB, without the cosine and without the mirror image of the coat: add Fresnel's reflectance times the surroundings for that.
// Every function stands beside the one of the same job in gonio, which it equals to single precision (docs/effect-coatings.md has the equations).

// ---- flake map: the file that `gonio fit M --model flake-map:K -o map.json` writes ----

struct GonioFlakeMap {
    // 1 over "index"
    inverse_index: f32,
    // "edge"
    edge: f32,
    // "nodes"
    nodes_inc: u32,
    nodes_flake: u32,
    // "bounds": smallest and largest y of each channel; w is of no account
    low: vec4<f32>,
    high: vec4<f32>,
    // "harmonics", 0 to 3
    harmonics: u32,
    // "transform": 0 for "cube-root", 1 for "log"
    logarithmic: u32,
    pad_a: u32,
    pad_b: u32,
}

@group(0) @binding(0) var<uniform> gonio_flake: GonioFlakeMap;
// "coefficients", one vec4 for three numbers of the file: over theta_inc, then theta_flake, then k
@group(0) @binding(1) var<storage, read> gonio_flake_coefficients: array<vec4<f32>>;

fn gonio_refract(d: vec3<f32>, inverse_index: f32) -> vec3<f32> {
    let flat = d.xy * inverse_index;
    return vec3<f32>(flat, sqrt(max(1.0 - dot(flat, flat), 0.0)));
}

// 1 + beta (1 - cos)^5, not below 0.05: what of f depends on one direction alone
fn gonio_edge(cosine: f32, edge: f32) -> f32 {
    let m = max(1.0 - cosine, 0.0);
    return max(1.0 + edge * (m * m * m * m * m), 0.05);
}

// Sum over k of c_k P_k at one node.
fn gonio_flake_node(first: u32, p1: f32, square: f32) -> vec4<f32> {
    var sum = gonio_flake_coefficients[first];
    var before = 1.0;
    var here = p1;
    for (var k = 1u; k <= gonio_flake.harmonics; k = k + 1u) {
        sum = sum + gonio_flake_coefficients[first + k] * here;
        // Chebyshev: cos 2(k + 1) from cos 2k and cos 2(k - 1), each with its amplitude
        let next = 2.0 * p1 * here - square * before;
        before = here;
        here = next;
    }
    return sum;
}

fn gonio_flake_map(light: vec3<f32>, view: vec3<f32>) -> vec3<f32> {
    if (min(light.z, view.z) < 0.0) {
        return vec3<f32>(0.0);
    }
    let l = gonio_refract(light, gonio_flake.inverse_index);
    let v = gonio_refract(view, gonio_flake.inverse_index);
    let s = l + v;
    let d = l - v;
    // sin^2 theta_inc = |d|^2 / 4, sin^2 theta_flake = |s_xy|^2 / |s|^2
    let inc2 = 0.25 * dot(d, d);
    let flat = dot(s.xy, s.xy);
    let flake2 = flat / max(flat + s.z * s.z, 1e-30);
    // p = sin theta_inc sin theta_flake; p cos phi_d = |d_z| / 2
    let p2 = inc2 * flake2;
    let share = 1.0 / (p2 + 0.003);
    let amplitude = p2 * share;
    let p1 = (0.5 * d.z * d.z - p2) * share;
    // nodes at equal steps of n sin theta_inc and sqrt(n sin theta_flake)
    let last = vec2<f32>(f32(gonio_flake.nodes_inc - 1u), f32(gonio_flake.nodes_flake - 1u));
    let place = vec2<f32>(sqrt(inc2) / gonio_flake.inverse_index, sqrt(sqrt(flake2) / gonio_flake.inverse_index));
    let x = min(place * last, last);
    let cell = min(floor(x), last - vec2<f32>(1.0));
    let t = x - cell;
    let terms = gonio_flake.harmonics + 1u;
    let row = gonio_flake.nodes_flake * terms;
    let at = u32(cell.x) * row + u32(cell.y) * terms;
    let square = amplitude * amplitude;
    let near = mix(gonio_flake_node(at, p1, square), gonio_flake_node(at + row, p1, square), t.x);
    let far = mix(gonio_flake_node(at + terms, p1, square), gonio_flake_node(at + row + terms, p1, square), t.x);
    let y = clamp(mix(near, far, t.y), gonio_flake.low, gonio_flake.high).xyz;
    let scale = gonio_edge(light.z, gonio_flake.edge) * gonio_edge(view.z, gonio_flake.edge);
    if (gonio_flake.logarithmic == 1u) {
        return scale * exp2(y);
    }
    return scale * (y * y * y);
}

// ---- colour map: in-plane f, Kirchner's map ----

struct GonioColourMap {
    // of the coat; 1 for the method unit-index
    index: f32,
    // 1 over 1 - cos of the largest angle
    per_end: f32,
    // along each angle
    nodes: u32,
    // beyond the critical angle: 0 clip, 1 map-vector, 2 map-vector-parallel, 3 unit-index
    method: u32,
}

@group(0) @binding(2) var<uniform> gonio_colour: GonioColourMap;
// The half of the mirror side first, then that of the light; in each over theta_ill, then theta_det, nodes at
// 1 - cos = (1 - cos of the largest) (k / (nodes - 1))^2
@group(0) @binding(3) var<storage, read> gonio_colour_values: array<vec4<f32>>;

struct GonioEquivalent {
    cos_ill: f32,
    cos_det: f32,
    mirror_side: bool,
}

// The in-plane geometry that sees the same flakes (Kirchner eqs. 5-7), by cosines alone.
fn gonio_in_plane(light: vec3<f32>, view: vec3<f32>) -> GonioEquivalent {
    let n = select(gonio_colour.index, 1.0, gonio_colour.method == 3u);
    let inverse = 1.0 / n;
    let critical2 = 1.0 - inverse * inverse;
    let critical = sqrt(max(critical2, 0.0));
    // distance of each refracted cosine from that of the critical angle
    let z = max(vec2<f32>(light.z, view.z), vec2<f32>(0.0)) * inverse;
    let inside = sqrt(max(vec2<f32>(critical2) + z * z, vec2<f32>(0.0)));
    let e = z * (z / max(inside + vec2<f32>(critical), vec2<f32>(1.1754944e-38)));
    let l = light.xy * inverse;
    let v = view.xy * inverse;
    let s = vec3<f32>(l + v, inside.x + inside.y);
    let d = vec3<f32>(l - v, e.x - e.y);
    let flat = dot(s.xy, s.xy);
    let sum2 = flat + s.z * s.z;
    let cross = l.x * v.y - l.y * v.x;
    let out_of_plane = cross * cross / max(sum2, 1.1754944e-38);
    let half_sum = 0.5 * (e.x + e.y);
    let far = half_sum + sqrt(0.25 * d.z * d.z + out_of_plane);
    let near = select(0.0, (e.x * e.y - out_of_plane) / far, far > 0.0);
    let ill2 = n * n * near * (near + 2.0 * critical);
    let det2 = n * n * far * (far + 2.0 * critical);
    var out: GonioEquivalent;
    out.mirror_side = 0.25 * dot(d, d) * sum2 >= flat;
    out.cos_ill = select(0.0, sqrt(clamp(ill2, 0.0, 1.0)), near > 0.0);
    out.cos_det = sqrt(clamp(det2, 0.0, 1.0));
    if (near < -1e-7 && (gonio_colour.method == 1u || gonio_colour.method == 2u)) {
        // the walk in the map by |c| = n sin theta_1' - 1
        let way = select(-1.0, 1.0, gonio_colour.method == 1u);
        let step = -ill2 / (1.0 + sqrt(1.0 - ill2));
        let side = select(-1.0, 1.0, out.mirror_side);
        let w = clamp(side * (1.0 - out.cos_det) + way * step, -1.0, 1.0);
        out.cos_det = 1.0 - abs(w);
        out.mirror_side = w >= 0.0;
    }
    return out;
}

fn gonio_colour_map(light: vec3<f32>, view: vec3<f32>) -> vec3<f32> {
    if (min(light.z, view.z) < 0.0) {
        return vec3<f32>(0.0);
    }
    let g = gonio_in_plane(light, view);
    let last = f32(gonio_colour.nodes - 1u);
    let share = clamp((vec2<f32>(1.0) - vec2<f32>(g.cos_ill, g.cos_det)) * gonio_colour.per_end, vec2<f32>(0.0), vec2<f32>(1.0));
    let x = sqrt(share) * last;
    let cell = min(floor(x), vec2<f32>(last - 1.0));
    let t = x - cell;
    let n = gonio_colour.nodes;
    let at = select(n * n, 0u, g.mirror_side) + u32(cell.x) * n + u32(cell.y);
    let near = mix(gonio_colour_values[at], gonio_colour_values[at + 1u], t.y);
    let far = mix(gonio_colour_values[at + n], gonio_colour_values[at + n + 1u], t.y);
    return mix(near, far, t.x).xyz;
}
