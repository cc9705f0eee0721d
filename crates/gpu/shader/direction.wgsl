// Length and direction of a vector, 0 if it has none. Twin: `direction` of incise-xpbd.
//
// Squares of lengths leave the range of single precision beyond 1e19 m and below 1e-19 m. The vector is therefore
// divided by its largest component first.

// The smallest number that every device distinguishes from 0.
const SMALLEST: f32 = 1.17549435e-38;

// The unit vector and the length, which is 0 if there is no direction.
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
