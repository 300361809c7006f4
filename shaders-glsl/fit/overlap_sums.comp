#version 460
// What the Dice loss needs of all samples before it can begin: Σ p t, Σ p and Σ t of each brick over the
// samples of the region (below 0: all that take part), p predicted and t wanted. One workgroup owns a brick;
// summed in a fixed order, every 64th sample together and then the 64 sums.
#define STORAGE_CONSTANT 0
#define QUANTITY_CONSTANT 2
#include "samples.glsl"
layout(local_size_x_id = 1) in;
layout(constant_id = 1) const uint GROUP = 64; // invocations of a workgroup: 64, or 8 for CPU drivers
layout(push_constant, scalar) uniform OverlapParams {
    uint first_slot; // of the chunk
    float region;
    float low;
} p;
layout(scalar, binding = 2) writeonly buffer Partials { vec3 partials[]; }; // [slot], all chunks
layout(scalar, binding = 3) readonly buffer Starts { uint starts[]; };      // [slot] of the chunk: its first pair
layout(scalar, binding = 4) readonly buffer UntouchedSums { vec3 untouched_sums[]; }; // [slot] of the chunk

shared vec3 partial[64];

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint slot = gl_WorkGroupID.x;
    if (starts[slot] == starts[slot + 1]) {
        // No splat reaches the brick: its sums are known.
        if (lane == 0) partials[p.first_slot + slot] = untouched_sums[slot];
        return;
    }
    uint begin = slot * 512;
    for (uint t = lane; t < 64; t += GROUP) {
        vec3 sum = vec3(0.0);
        for (uint i = begin + t; i < begin + 512; i += 64) {
            Target wanted = target_at(i);
            if (!(wanted.occupancy >= 0.0 && wanted.occupancy > p.region)) continue;
            vec2 both = compared(wanted, reconstruction_at(i), p.low);
            sum += vec3(both.x * both.y, both.x, both.y);
        }
        partial[t] = sum;
    }
    SUM_OF_64(partial, lane, GROUP)
    if (lane == 0) partials[p.first_slot + slot] = partial[0];
}
