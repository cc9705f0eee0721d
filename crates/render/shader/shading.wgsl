// Surface color of a pixel in linear light: twin of shading.rs, function by function.

const TISSUE = vec3<f32>(0.245, 0.044, 0.036);
const FLESH = vec3<f32>(0.780, 0.290, 0.250);
const GLOSS: f32 = 0.55;
const FLESH_GLOSS: f32 = 0.35;

const SKY = vec3<f32>(0.50, 0.54, 0.60);
const EARTH = vec3<f32>(0.235, 0.205, 0.195);
const KEY = vec3<f32>(1.12, 1.06, 0.96);
const LINE = vec3<f32>(0.012, 0.012, 0.018);
// Factor of the distance from the rim of a cut.
const RIM: f32 = 0.5;
const TOP = vec3<f32>(0.92, 0.935, 0.955);
const BOTTOM = vec3<f32>(0.66, 0.69, 0.73);

// Normalized vector; up for a vector of length 0.
fn direction(v: vec3<f32>) -> vec3<f32> {
    let squared = dot(v, v);
    if squared > 0.0 {
        return v / sqrt(squared);
    }
    return vec3<f32>(0.0, 0.0, 1.0);
}

// Converts sRGB channels to linear light.
fn decode(c: vec3<f32>) -> vec3<f32> {
    let high = pow((c + 0.055) / 1.055, vec3<f32>(2.4));
    return select(high, c / 12.92, c <= vec3<f32>(0.04045));
}

// Base color of a skin triangle from its color word (0: tissue) and whether it is a cut face; w: its gloss.
fn skin_base(word: u32, cut: bool) -> vec4<f32> {
    if word == 0u {
        if cut {
            return vec4<f32>(FLESH, FLESH_GLOSS);
        }
        return vec4<f32>(TISSUE, GLOSS);
    }
    let base = decode(unpack4x8unorm(word).xyz);
    if cut {
        return vec4<f32>(mix(base, vec3<f32>(1.0), 0.30), 0.15);
    }
    return vec4<f32>(base, 0.25);
}

// Shading normal of a skin triangle: cut faces are shaded flatter than others.
fn skin_normal(normal: vec3<f32>, face: vec3<f32>, cut: bool, smoothly: bool) -> vec3<f32> {
    if !smoothly {
        return face;
    }
    let share = select(0.0, 0.35, cut);
    return direction(mix(direction(normal), face, share));
}

// Light that a surface reflects to the eye.
fn shade(base_color: vec3<f32>, glossiness: f32, position: vec3<f32>, shading: vec3<f32>, face: vec3<f32>) -> vec3<f32> {
    let to_eye = direction(-position);
    let light = view.light.xyz;
    var normal = shading;
    var base = base_color;
    var gloss = glossiness;
    if dot(face, to_eye) < 0.0 {
        // Back side.
        normal = -normal;
        base = base * 0.5;
        gloss = gloss * 0.3;
    }
    let sky = 0.5 + 0.5 * normal.z;
    let ambient = mix(EARTH, SKY, sky);
    let toward = dot(normal, light);
    let key = max((toward + 0.2) / 1.2, 0.0);
    let diffuse = base * (ambient + KEY * (key * key * 0.4 + key * 0.6));
    let half = max(dot(normal, direction(light + to_eye)), 0.0);
    let p2 = half * half;
    let p4 = p2 * p2;
    let p8 = p4 * p4;
    let p16 = p8 * p8;
    let p32 = p16 * p16;
    let highlight = gloss * (0.34 * p32 * p32 + 0.10 * p16) * smoothstep(0.0, 0.2, toward);
    let grazing = 1.0 - max(dot(normal, to_eye), 0.0);
    let g2 = grazing * grazing;
    let rim = g2 * g2 * (0.05 + 0.15 * gloss);
    return diffuse + KEY * highlight + ambient * rim;
}

// Draws the edges of a triangle over a color, given the distances to them in pixels.
fn wire(color: vec3<f32>, distances: vec3<f32>) -> vec3<f32> {
    let nearest = min(distances.x, min(distances.y, distances.z));
    let share = 1.0 - smoothstep(0.2, 1.1, nearest);
    return mix(color, LINE, 0.75 * share);
}

// Background color at a fraction of the image height from the top.
fn background(y: f32) -> vec3<f32> {
    return mix(TOP, BOTTOM, y * y * (3.0 - 2.0 * y));
}
