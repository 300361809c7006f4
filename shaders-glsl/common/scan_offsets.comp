#version 460
// Second step of an exclusive prefix sum: block sums become block offsets, in place. One workgroup owns all,
// one invocation a run of neighbouring sums.
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 256) in;
layout(push_constant, scalar) uniform ScanParams { uint count; } p; // number of block sums
layout(scalar, binding = 0) buffer BlockSums { uint block_sums[]; };

shared uint partial[256];

void main() {
    uint t = gl_LocalInvocationIndex;
    uint run = (p.count + 255) / 256;
    uint begin = min(t * run, p.count);
    uint end = min(begin + run, p.count);
    uint sum = 0;
    for (uint i = begin; i < end; ++i) sum += block_sums[i];
    partial[t] = sum;
    barrier();
    // 256 partial sums: a serial scan by one invocation costs less than the barriers of a parallel one.
    if (t == 0) {
        uint total = 0;
        for (uint i = 0; i < 256; ++i) {
            uint s = partial[i];
            partial[i] = total;
            total += s;
        }
    }
    barrier();
    uint offset = partial[t];
    for (uint i = begin; i < end; ++i) {
        uint s = block_sums[i];
        block_sums[i] = offset;
        offset += s;
    }
}
