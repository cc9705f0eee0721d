// Between two rounds: computes the workgroups of the next one and empties the list that it fills.
//
// The arguments of an indirect dispatch cannot be bound by the dispatch that reads them, so this is
// a separate kernel of one thread.

@group(0) @binding(2) var<storage, read_write> arguments: array<u32, 3>;

@compute @workgroup_size(1)
fn main() {
    let done = current.parity;
    if atomicLoad(&work.counts[done]) > 0u {
        work.rounds += 1u;
    }
    atomicStore(&work.counts[done], 0u);
    arguments = grid(atomicLoad(&work.counts[1u - done]));
}
