// A round of shortcut graph coloring (paper section 4.1, Algorithm 1) without a list of edges.
//
// Constraints on one particle have distinct colors, so a particle stores a bit per used color, and a constraint may get
// the colors that none of its particles has used: a few words instead of all neighbors. The colors are processed in
// windows of 64, which takes two words per particle without a limit on colors: a constraint without a color in the
// first window waits for the second. This gives the colors of one pass with all colors, since only constraints with a
// color in a window affect it.
//
// Pending neighbors of higher priority are handled as in `scgc.wgsl`, with shortcuts 1 and 3; the colors do not depend
// on the order within a round, for the reasons given there. Shortcut 2 drops edges and does not apply. A neighbor that
// shares several particles is visited several times. Cost: a round walks the neighbors of the constraints whose last
// blocking neighbor is colored, and reads one word for all others.

@group(0) @binding(4) var<storage, read> degrees: array<u32>;
@group(0) @binding(5) var<storage, read_write> colors: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> waits: array<Wait>;
// Two words per particle.
@group(0) @binding(7) var<storage, read_write> taken: array<atomic<u32>>;

// The colors of the window that are unavailable to v.
fn taken_around(v: u32) -> vec2<u32> {
    var around = vec2<u32>(0u, 0u);
    for (var i = particles_of[v]; i < particles_of[v + 1u]; i++) {
        let p = particles_of[i];
        around.x |= atomicLoad(&taken[2u * p]);
        around.y |= atomicLoad(&taken[2u * p + 1u]);
    }
    return around;
}

// True if u prevents a constraint of lower priority from taking `best`, color `bit` of the window.
fn stops(u: u32, best: u32, bit: u32) -> bool {
    let color = atomicLoad(&colors[u]);
    if color < PENDING {
        // An equal color of u was marked after v read the marks.
        return color == best;
    }
    if best < (color & ~PENDING) {
        return false;
    }
    return ((atomicLoad(&waits[u].taken[bit >> 5u]) >> (bit & 31u)) & 1u) == 0u;
}

// Colors v if possible; returns true if v stays on the list.
fn stays_after(v: u32) -> bool {
    let around = taken_around(v);
    atomicStore(&waits[v].taken[0], around.x);
    atomicStore(&waits[v].taken[1], around.y);
    var bit = countTrailingZeros(~around.x);
    if around.x == 0xffffffffu {
        bit = 32u + countTrailingZeros(~around.y);
        if around.y == 0xffffffffu {
            // No color of this window is left.
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
