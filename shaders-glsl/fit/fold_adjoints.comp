#version 460
// Turns (dL/dV^, dL/dW) of a sample into what the backward pass multiplies with a splat's intensity c, in place:
// A = dL/dV^ / (W + ε) and H = dL/dW - A V^, so that dL/dw = A c + H and dL/dc = A w. One workgroup owns a brick, one
// invocation every 64th sample.
#include "splat.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform FoldParams { float epsilon; } p;
layout(scalar, binding = 0) readonly buffer Reconstructions { Reconstruction reconstructions[]; };
layout(scalar, binding = 1) buffer Adjoints { Adjoint adjoints[]; };

void main() {
    uint begin = gl_WorkGroupID.x * 512 + gl_LocalInvocationIndex;
    for (uint i = begin; i < begin + 512; i += 64) {
        Reconstruction r = reconstructions[i];
        Adjoint g = adjoints[i];
        float a = g.value / (r.weight + p.epsilon);
        adjoints[i] = Adjoint(a, g.weight - a * r.value);
    }
}
