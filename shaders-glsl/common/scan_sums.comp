#version 460
// First step of an exclusive prefix sum: the sum of each block of 4096 elements.
// One workgroup owns one block, one invocation 16 neighbouring elements.
#extension GL_EXT_scalar_block_layout : require
#include "scan.glsl"
layout(local_size_x = 256) in;
layout(push_constant, scalar) uniform ScanParams { uint count; } p;
layout(scalar, binding = 0) readonly buffer Values { uint values[]; };
layout(scalar, binding = 1) writeonly buffer BlockSums { uint block_sums[]; };

shared uint partial[256];

void main() {
    uint t = gl_LocalInvocationIndex;
    uint begin = gl_WorkGroupID.x * SCAN_BLOCK + t * SCAN_RUN;
    uint end = min(begin + SCAN_RUN, p.count);
    uint sum = 0;
    for (uint i = begin; i < end; ++i) sum += values[i];
    partial[t] = sum;
    for (uint half_size = 128; half_size > 0; half_size >>= 1) {
        barrier();
        if (t < half_size) partial[t] += partial[t + half_size];
    }
    if (t == 0) block_sums[gl_WorkGroupID.x] = partial[0];
}
