#version 460
// The sum of all rows of three floats, in a fixed order: one workgroup owns all, one invocation every 256th
// row. In f32: the relative error is that of count / 256 + 8 additions, 1e-6 or so for the bricks of a large
// volume.
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 256) in;
layout(push_constant, scalar) uniform SumParams { uint count; } p;
layout(scalar, binding = 0) readonly buffer Partials { vec3 partials[]; };
layout(scalar, binding = 1) writeonly buffer Total { vec3 total[]; }; // [0]

shared vec3 partial[256];

void main() {
    uint t = gl_LocalInvocationIndex;
    vec3 sum = vec3(0.0);
    for (uint i = t; i < p.count; i += 256) sum += partials[i];
    partial[t] = sum;
    for (uint half_size = 128; half_size > 0; half_size >>= 1) {
        barrier();
        if (t < half_size) partial[t] += partial[t + half_size];
    }
    if (t == 0) total[0] = partial[0];
}
