// The volume that four particles span. Twin: `volume.rs` of incise-xpbd.

fn solve_constraint(index: u32) {
    let corner = corners[index];
    let scale = numbers[index].x;
    if !(scale > 0.0) {
        return;
    }
    let a = particles[corner.x];
    let b = particles[corner.y];
    let c = particles[corner.z];
    let d = particles[corner.w];
    let e1 = b.xyz - a.xyz;
    let e2 = c.xyz - a.xyz;
    let e3 = d.xyz - a.xyz;
    // Edges are scaled before they are multiplied, so that tets of micrometers stay in the range of
    // single precision.
    let g1 = cross(e2 * scale, e3);
    let g2 = cross(e3 * scale, e1);
    let g3 = cross(e1 * scale, e2);
    let g0 = -(g1 + g2 + g3);
    let value = dot(g1, e1) - settings.one;
    var rate = 0.0;
    if DAMPED {
        rate = dot(g0, a.xyz - previous[corner.x].xyz);
        rate += dot(g1, b.xyz - previous[corner.y].xyz);
        rate += dot(g2, c.xyz - previous[corner.z].xyz);
        rate += dot(g3, d.xyz - previous[corner.w].xyz);
    }
    let steepness = a.w * dot(g0, g0) + b.w * dot(g1, g1) + c.w * dot(g2, g2) + d.w * dot(g3, g3);
    let change = solve(index, value, rate, steepness, false);
    if change != 0.0 {
        particles[corner.x] = vec4(a.xyz + g0 * (a.w * change), a.w);
        particles[corner.y] = vec4(b.xyz + g1 * (b.w * change), b.w);
        particles[corner.z] = vec4(c.xyz + g2 * (c.w * change), c.w);
        particles[corner.w] = vec4(d.xyz + g3 * (d.w * change), d.w);
    }
}
