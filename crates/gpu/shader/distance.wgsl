// The distance of two particles. Twin: `distance.rs` of incise-xpbd.

fn solve_constraint(index: u32) {
    let corner = corners[index];
    let a = particles[corner.x];
    let b = particles[corner.y];
    let away = direction(a.xyz - b.xyz);
    // Coincident particles have no direction; other constraints must separate them first.
    if !(away.w > 0.0) {
        return;
    }
    let along = away.xyz;
    var rate = 0.0;
    if DAMPED {
        rate = dot(along, a.xyz - previous[corner.x].xyz) - dot(along, b.xyz - previous[corner.y].xyz);
    }
    let square = dot(along, along);
    let steepness = a.w * square + b.w * square;
    let change = solve(index, away.w - numbers[index].x, rate, steepness, corner.z != 0u);
    if change != 0.0 {
        particles[corner.x] = vec4(a.xyz + along * (a.w * change), a.w);
        particles[corner.y] = vec4(b.xyz - along * (b.w * change), b.w);
    }
}
