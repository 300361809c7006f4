#version 460
// One pass of a stable radix sort, first half: how often each 6-bit digit occurs in each block of 2048 keys.
// One workgroup owns a block. Blocks behind the last key count nothing, so the host may dispatch for a
// capacity.
#extension GL_EXT_scalar_block_layout : require
#include "radix.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform RadixParams { uint shift; uint blocks; uint count_index; uint capacity; } p;
layout(scalar, binding = 0) readonly buffer Counts { uint counts[]; };
layout(scalar, binding = 1) readonly buffer Keys { uint keys[]; };
layout(scalar, binding = 2) writeonly buffer Table { uint table[]; }; // [digit][block]

shared uint histogram[DIGITS];

void main() {
    uint t = gl_LocalInvocationIndex;
    uint block = gl_WorkGroupID.x;
    uint count = min(counts[p.count_index], p.capacity);
    histogram[t] = 0;
    barrier();
    for (uint i = block * RADIX_BLOCK + t; i < min(block * RADIX_BLOCK + RADIX_BLOCK, count); i += 64) {
        atomicAdd(histogram[(keys[i] >> p.shift) & (DIGITS - 1u)], 1u);
    }
    barrier();
    table[t * p.blocks + block] = histogram[t];
}
