// A round of shortcut graph coloring (paper section 4.1, Algorithm 1) that never sees an edge.
//
// Constraints on one particle all differ, so a particle has a bit per color for "taken here", and what a constraint
// may get is what none of its particles has taken: a few words instead of all neighbors. To be without a limit on
// colors and with two words a particle, this works in windows of 64 colors: a constraint that finds none in the first
// window waits for the second. That gives the colors of one pass with all colors, since whether a constraint fits into
// a window depends only on those that got a color in it.
//
// Neighbors of higher priority are waited for as in `scgc.wgsl`, with shortcuts 1 and 3, and for the reasons given
// there the colors do not depend on what a constraint sees of the others in a round. Shortcut 2 drops edges, and there
// are none. A neighbor that shares several particles is looked at several times. Cost: a round walks the neighbors of
// the constraints whose last obstacle is gone, and looks at one word for all others.

@group(0) @binding(4) var<storage, read> degrees: array<u32>;
@group(0) @binding(5) var<storage, read_write> colors: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> waits: array<Wait>;
// Two words per particle.
@group(0) @binding(7) var<storage, read_write> taken: array<atomic<u32>>;

// The colors of the window that v cannot get.
fn taken_around(v: u32) -> vec2<u32> {
    var around = vec2<u32>(0u, 0u);
    for (var i = particles_of[v]; i < particles_of[v + 1u]; i++) {
        let p = particles_of[i];
        around.x |= atomicLoad(&taken[2u * p]);
        around.y |= atomicLoad(&taken[2u * p + 1u]);
    }
    return around;
}

// Does u keep a constraint of lower priority from taking `best`, color `bit` of the window?
fn stops(u: u32, best: u32, bit: u32) -> bool {
    let held = atomicLoad(&colors[u]);
    if held < PENDING {
        // If it is the same, u has told so after v looked.
        return held == best;
    }
    if best < (held & ~PENDING) {
        return false;
    }
    return ((atomicLoad(&waits[u].taken[bit >> 5u]) >> (bit & 31u)) & 1u) == 0u;
}

// Colors v if it can be; says whether v stays on the list.
fn stays_after(v: u32) -> bool {
    let around = taken_around(v);
    atomicStore(&waits[v].taken[0], around.x);
    atomicStore(&waits[v].taken[1], around.y);
    var bit = countTrailingZeros(~around.x);
    if around.x == 0xffffffffu {
        bit = 32u + countTrailingZeros(~around.y);
        if around.y == 0xffffffffu {
            // Nothing in this window.
            atomicStore(&colors[v], PENDING | (work.window + 64u));
            atomicAdd(&work.rest, 1u);
            return false;
        }
    }
    let best = work.window + bit;
    atomicStore(&colors[v], PENDING | best);
    let last = waits[v].stopped_by;
    if last > 0u && stops(last - 1u, best, bit) {
        return true;
    }
    for (var i = particles_of[v]; i < particles_of[v + 1u]; i++) {
        let p = particles_of[i];
        for (var k = constraints_of[p]; k < constraints_of[p + 1u]; k++) {
            let u = constraints_of[k];
            if u != v && precedes(u, degrees[u], v, degrees[v]) && stops(u, best, bit) {
                waits[v].stopped_by = u + 1u;
                return true;
            }
        }
    }
    atomicStore(&colors[v], best);
    note_color(best);
    for (var i = particles_of[v]; i < particles_of[v + 1u]; i++) {
        atomicOr(&taken[2u * particles_of[i] + (bit >> 5u)], 1u << (bit & 31u));
    }
    return false;
}

@compute @workgroup_size(THREADS)
fn main(
    @builtin(workgroup_id) id: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = workgroup_index(id, count) * THREADS + thread;
    var v = 0u;
    var stays = false;
    if i < listed_count() {
        v = listed(i);
        stays = stays_after(v);
    }
    keep(stays, v, thread);
}
