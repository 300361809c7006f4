#version 460
// Third step of an exclusive prefix sum: offsets[i] = values[0] + .. + values[i-1] for i in 0..=count (the
// last one is the total). One workgroup owns a block of 4096, one invocation 16 neighbours.
#extension GL_EXT_scalar_block_layout : require
#include "scan.glsl"
layout(local_size_x = 256) in;
layout(push_constant, scalar) uniform ScanParams { uint count; } p;
layout(scalar, binding = 0) readonly buffer Values { uint values[]; };
layout(scalar, binding = 1) readonly buffer BlockSums { uint block_sums[]; };
layout(scalar, binding = 2) writeonly buffer Offsets { uint offsets[]; };

shared uint partial[256];

void main() {
    uint t = gl_LocalInvocationIndex;
    uint begin = gl_WorkGroupID.x * SCAN_BLOCK + t * SCAN_RUN;
    uint end = min(begin + SCAN_RUN, p.count);
    uint sum = 0;
    for (uint i = begin; i < end; ++i) sum += values[i];
    partial[t] = sum;
    barrier();
    if (t < 16) { // sixteen runs of sixteen, scanned side by side ...
        uint total = 0;
        for (uint i = t * 16; i < t * 16 + 16; ++i) {
            total += partial[i];
            partial[i] = total;
        }
    }
    barrier();
    uint offset = block_sums[gl_WorkGroupID.x];
    for (uint r = 0; r < t / 16; ++r) offset += partial[r * 16 + 15]; // ... and joined
    if ((t & 15) != 0) offset += partial[t - 1];
    for (uint i = begin; i < end; ++i) {
        offsets[i] = offset;
        offset += values[i];
    }
    if (end == p.count && (begin < p.count || (p.count == 0 && t == 0))) offsets[p.count] = offset;
}
