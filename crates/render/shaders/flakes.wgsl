// Flakes of car paints for renderers: drawn from their statistics, two to four paints blended on the way. Copy this file, fill the header and
// the four buffers (gonio_paint::mixing::ShaderFlakes has them ready), call gonio_flakes.
//
// Directions are unit vectors in the frame of the surface, z along the normal, both pointing away from it. What comes back is Xi in 1/sr, linear
// Rec. 709 RGB, inside the coat: multiply by what the coat lets through, add the base. Draws are those of gonio, place for place.

const GONIO_STEPS: f32 = 500.0;

struct GonioFlakes {
    // weights of up to four paints, for the lightness of the flakes and for their hue; 0 for paints that are not there
    lightness: vec4<f32>,
    hue: vec4<f32>,
    // 1 over the index of the coat
    inverse_index: f32,
    // side of a texel on the surface
    texel_mm: f32,
    half_count: u32,
    incidence_count: u32,
    // texels along a side of the random texture
    side: u32,
    paints: u32,
    // boxes of a paint over all slices
    paths: u32,
    pad: u32,
}

@group(0) @binding(0) var<uniform> gonio_flakes_header: GonioFlakes;
// sines of the half angles, then of the angles of incidence
@group(0) @binding(1) var<storage, read> gonio_flakes_sines: array<f32>;
// box of each step, slice by slice, counted over all slices
@group(0) @binding(2) var<storage, read> gonio_flakes_inverse: array<u32>;
// paint by paint, box by box: one corner in Lab, then the other
@group(0) @binding(3) var<storage, read> gonio_flakes_corners: array<vec4<f32>>;
// three random numbers a texel, row by row
@group(0) @binding(4) var<storage, read> gonio_flakes_random: array<vec4<f32>>;

fn gonio_flakes_refract(d: vec3<f32>, inverse_index: f32) -> vec3<f32> {
    let flat = d.xy * inverse_index;
    return vec3<f32>(flat, sqrt(max(1.0 - dot(flat, flat), 0.0)));
}

// node below a sine and the share of the next one
fn gonio_flakes_locate(start: u32, count: u32, sine: f32) -> vec2<f32> {
    var below = 0u;
    var above = count - 1u;
    if (!(sine > gonio_flakes_sines[start])) {
        return vec2<f32>(0.0, 0.0);
    }
    if (sine >= gonio_flakes_sines[start + above]) {
        return vec2<f32>(f32(above), 0.0);
    }
    while (above - below > 1u) {
        let middle = (above + below) / 2u;
        if (gonio_flakes_sines[start + middle] <= sine) {
            below = middle;
        } else {
            above = middle;
        }
    }
    let a = gonio_flakes_sines[start + below];
    return vec2<f32>(f32(below), (sine - a) / (gonio_flakes_sines[start + above] - a));
}

// blended corner of a box (Golla and Klein 2018, eqs. 14 and 15)
fn gonio_flakes_corner(path: u32, which: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < gonio_flakes_header.paints; k++) {
        let corner = gonio_flakes_corners[(k * gonio_flakes_header.paths + path) * 2u + which].xyz;
        let l = gonio_flakes_header.lightness[k];
        let h = gonio_flakes_header.hue[k];
        sum += vec3<f32>(l, h, h) * corner;
    }
    return sum;
}

fn gonio_flakes_inverse_curve(f: f32) -> f32 {
    return select((116.0 * f - 16.0) * 27.0 / 24389.0, f * f * f, f > 6.0 / 29.0);
}

// BRDF value of a Lab colour against D65
fn gonio_flakes_colour(lab: vec3<f32>) -> vec3<f32> {
    let y = (lab.x + 16.0) / 116.0;
    let xyz = vec3<f32>(
        gonio_flakes_inverse_curve(y + lab.y / 500.0) * 0.95045593,
        gonio_flakes_inverse_curve(y),
        gonio_flakes_inverse_curve(y - lab.z / 200.0) * 1.0890577,
    );
    return vec3<f32>(
        dot(vec3<f32>(3.2409699, -1.5373832, -0.49861076), xyz),
        dot(vec3<f32>(-0.96924365, 1.8759675, 0.041555058), xyz),
        dot(vec3<f32>(0.05563008, -0.20397696, 1.0569715), xyz),
    ) * 0.31830989;
}

// colour of a texel's first number in a slice
fn gonio_flakes_draw(slice: u32, number: f32) -> vec3<f32> {
    let s = f32(slice % 4096u);
    let along = fract(number + fract(s * 0.8566749)) * GONIO_STEPS;
    let step = min(floor(along), GONIO_STEPS - 1.0);
    let inside = along - step;
    let r = fract(inside * vec3<f32>(1.0, 7.0, 13.0)
        + fract(step * vec3<f32>(0.8191725, 0.6710436, 0.5497005))
        + fract(s * vec3<f32>(0.7338919, 0.6287067, 0.5385973)));
    let path = gonio_flakes_inverse[slice * u32(GONIO_STEPS) + u32(step)];
    let low = gonio_flakes_corner(path, 0u);
    let high = gonio_flakes_corner(path, 1u);
    return gonio_flakes_colour(low + r * (high - low));
}

// Xi at a place of the surface, mm
fn gonio_flakes(light: vec3<f32>, view: vec3<f32>, position_mm: vec2<f32>) -> vec3<f32> {
    let h = gonio_flakes_header;
    let l = gonio_flakes_refract(light, h.inverse_index);
    let v = gonio_flakes_refract(view, h.inverse_index);
    let s = l + v;
    let length_s = length(s);
    let sin_half = select(0.0, min(length(s.xy) / length_s, 1.0), length_s > 0.0);
    let sin_incidence = min(0.5 * length(l - v), 1.0);
    let half = gonio_flakes_locate(0u, h.half_count, sin_half);
    let incidence = gonio_flakes_locate(h.half_count, h.incidence_count, sin_incidence);
    let side = i32(h.side);
    let texel = vec2<i32>(floor(position_mm / h.texel_mm));
    let wrapped = ((texel % side) + side) % side;
    let numbers = gonio_flakes_random[u32(wrapped.y * side + wrapped.x)].xyz;
    // each texel changes over from slice to slice at an angle of its own
    let a = u32(half.x) + u32(numbers.y < half.y);
    let b = u32(incidence.x) + u32(numbers.z < incidence.y);
    return gonio_flakes_draw(a * h.incidence_count + b, numbers.x);
}
