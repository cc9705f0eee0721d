// Length and direction of a vector, for every vector that has one. Twin: `direction` of incise-xpbd.
//
// Squares of lengths leave the range of single precision beyond 1e19 m and below 1e-19 m. Divided by its largest
// component first, a vector keeps its direction however long or short it is.

// The smallest number that every device tells from 0.
const SMALLEST: f32 = 1.17549435e-38;

// The vector of length 1, and the length; that is 0 if there is no direction.
fn direction(v: vec3<f32>) -> vec4<f32> {
    let a = abs(v);
    let largest = max(max(a.x, a.y), a.z);
    if !are_finite(v) || largest < SMALLEST {
        return vec4(0.0);
    }
    let scaled = v / largest;
    let length = sqrt(dot(scaled, scaled));
    return vec4(scaled * (settings.one / length), largest * length);
}
