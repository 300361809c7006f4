#version 460
// Writes a (slot, splat) pair for each brick of this chunk that a splat's box touches. One invocation owns a
// splat and the run of pairs that the prefix sum gave it; pairs behind the capacity are dropped (the host
// sees the total, grows the buffers and repeats the step).
#include "splat.glsl"
#include "brick.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform SplatParams { Grid grid; uint splat_count; uint capacity; vec3 stretch; } p;
layout(scalar, binding = 0) readonly buffer Footprints { Footprint footprints[]; };
layout(scalar, binding = 1) readonly buffer Slots { uint slots[]; };
layout(scalar, binding = 2) readonly buffer PairOffsets { uint pair_offsets[]; };
layout(scalar, binding = 3) writeonly buffer Keys { uint keys[]; };
layout(scalar, binding = 4) writeonly buffer Values { uint values[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.splat_count) return;
    uint at = pair_offsets[i];
    if (at == pair_offsets[i + 1]) return;
    ivec3 first, last;
    sample_box(footprints[i], p.grid, first, last);
    uvec3 lo = uvec3(first) >> 3, hi = uvec3(last) >> 3;
    for (uint z = lo.z; z <= hi.z; ++z)
        for (uint y = lo.y; y <= hi.y; ++y)
            for (uint x = lo.x; x <= hi.x; ++x) {
                uint slot = slots[brick_index(uvec3(x, y, z), p.grid.bricks)] - p.grid.first_slot;
                if (slot >= p.grid.slot_count) continue;
                if (at < p.capacity) {
                    keys[at] = slot;
                    values[at] = i;
                }
                at += 1;
            }
}
