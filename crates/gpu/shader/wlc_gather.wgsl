// Third part of a step of WLC: winners get their color, losers go to the next worklist in order, and the next chunk is
// set.
//
// One workgroup, each thread a range of the chunk: the order of the list determines which vertices share a chunk and
// must be kept. Chunks are halved after a round in which more than half of the list lost. Cost: O(chunk / 64).

@group(0) @binding(1) var<storage, read_write> work: WlcWork;
@group(0) @binding(2) var<storage, read_write> arguments: array<u32, 3>;
@group(0) @binding(3) var<storage, read> lost: array<u32>;
@group(0) @binding(4) var<storage, read_write> picked: array<u32>;
@group(0) @binding(5) var<storage, read_write> colors: array<u32>;

var<workgroup> losers: array<u32, THREADS>;

@compute @workgroup_size(THREADS)
fn main(@builtin(local_invocation_index) thread: u32) {
    let length = min(work.chunk, work.count - work.done);
    let part = (length + THREADS - 1u) / THREADS;
    let begin = min(thread * part, length);
    let end = min(begin + part, length);
    var sum = 0u;
    for (var i = begin; i < end; i++) {
        sum += lost[i];
    }
    losers[thread] = sum;
    workgroupBarrier();
    let other = current.vertices - work.begin;
    var position = work.lost;
    for (var earlier = 0u; earlier < thread; earlier++) {
        position += losers[earlier];
    }
    for (var i = begin; i < end; i++) {
        let v = work.list[work.begin + work.done + i];
        if lost[i] == 1u {
            work.list[other + position] = v;
            position += 1u;
        } else {
            colors[v] = picked[v];
        }
        picked[v] = NONE;
    }
    // The last thread has the number of losers; by now all threads have read the values that it changes.
    storageBarrier();
    workgroupBarrier();
    if thread == THREADS - 1u && length > 0u {
        work.lost = position;
        work.done += length;
        if work.done == work.count {
            work.rounds += 1u;
            if work.lost > work.count / 2u {
                work.chunk = max(work.chunk / 2u, 1u);
            }
            work.begin = other;
            work.count = work.lost;
            work.done = 0u;
            work.lost = 0u;
        }
        arguments = grid(min(work.chunk, work.count - work.done));
    }
}
