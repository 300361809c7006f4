#version 460
// One pass of a stable radix sort, second half: moves each (key, value) to its place. `offsets` holds the
// prefix sum of what radix_count wrote. One workgroup owns a block of 2048, one invocation 32 neighbours,
// which it counts by digit, then moves in order: stable, without subgroup operations, three barriers.
#extension GL_EXT_scalar_block_layout : require
#include "radix.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform RadixParams { uint shift; uint blocks; uint count_index; uint capacity; } p;
layout(scalar, binding = 0) readonly buffer Counts { uint counts[]; };
layout(scalar, binding = 1) readonly buffer Keys { uint keys[]; };
layout(scalar, binding = 2) readonly buffer Values { uint values[]; };
layout(scalar, binding = 3) readonly buffer Offsets { uint offsets[]; };
layout(scalar, binding = 4) writeonly buffer SortedKeys { uint sorted_keys[]; };
layout(scalar, binding = 5) writeonly buffer SortedValues { uint sorted_values[]; };

const uint STRIDE = DIGITS + 1; // one more to keep shared-memory banks apart
const uint RUN = RADIX_BLOCK / 64;
shared uint places[64 * STRIDE]; // [invocation][digit]

void main() {
    uint t = gl_LocalInvocationIndex;
    uint block = gl_WorkGroupID.x;
    uint count = min(counts[p.count_index], p.capacity);
    if (block * RADIX_BLOCK >= count) return;
    uint begin = block * RADIX_BLOCK + t * RUN;
    uint end = min(begin + RUN, count);
    for (uint d = 0; d < DIGITS; ++d) places[d * STRIDE + t] = 0;
    barrier();
    for (uint i = begin; i < end; ++i) places[t * STRIDE + ((keys[i] >> p.shift) & (DIGITS - 1u))] += 1;
    barrier();
    uint place = offsets[t * p.blocks + block]; // invocation t scans digit t over the invocations
    for (uint i = 0; i < 64; ++i) {
        uint n = places[i * STRIDE + t];
        places[i * STRIDE + t] = place;
        place += n;
    }
    barrier();
    for (uint i = begin; i < end; ++i) {
        uint key = keys[i];
        uint at = t * STRIDE + ((key >> p.shift) & (DIGITS - 1u));
        uint to = places[at];
        places[at] = to + 1;
        sorted_keys[to] = key;
        sorted_values[to] = values[i];
    }
}
