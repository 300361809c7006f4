#version 460
// dL/d(parameters) of one splat an invocation, from the moments that splat_to_volume_grad summed. U is the
// whitening matrix S^-1 R^T D^-1, B = U S2 U^T, a the amplitude of w, α times the kernel's peak:
//   dL/dμ = a U^T U S1,   dL/dln s_k = a B_kk,   dL/dω_k = a B_ij (s_i/s_j - s_j/s_i) with (i, j, k) cyclic,
//   dL/dlogit = a (1 - α) S0,   dL/dc = a C0.
// Where the peak is 1 / ((2π)^(3/2) s1 s2 s3), dln a/dln s_k = -1 and dL/dln s_k = a (B_kk - S0).
// ω is a small rotation about the splat's own axes: it changes u_i by ω_k (s_j/s_i) u_j.
#include "splat.glsl"
#include "kernel.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform MomentParams { uint splat_count; vec3 stretch; } p;
layout(scalar, binding = 0) readonly buffer Splats { Splat splats[]; };
layout(scalar, binding = 1) readonly buffer MomentRows { float moments[]; }; // [splat][11]
layout(scalar, binding = 2) writeonly buffer Gradients { SplatGrad gradients[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.splat_count) return;
    Splat s = splats[i];
    uint at = i * MOMENTS;
    float s0 = moments[at], c0 = moments[at + 1];
    vec3 s1 = vec3(moments[at + 2], moments[at + 3], moments[at + 4]);
    float xx = moments[at + 5], yy = moments[at + 6], zz = moments[at + 7];
    float yz = moments[at + 8], zx = moments[at + 9], xy = moments[at + 10];
    float opacity = 1.0 / (1.0 + exp(-s.opacity_logit));
    float amplitude = kernel_peak(s.log_scale) * opacity;
    mat3 whiten = whitening(s, p.stretch);
    mat3 s2 = mat3(xx, xy, zx, xy, yy, yz, zx, yz, zz);
    mat3 b = whiten * s2 * transpose(whiten);
    vec3 ln_s = s.log_scale;
    vec3 ratio = exp(vec3(ln_s.y - ln_s.z, ln_s.z - ln_s.x, ln_s.x - ln_s.y));
    SplatGrad g;
    g.mean = amplitude * (transpose(whiten) * (whiten * s1));
    vec3 by_log_scale = vec3(b[0][0], b[1][1], b[2][2]);
    if (KERNEL == KERNEL_DENSITY) by_log_scale -= s0;
    g.log_scale = amplitude * by_log_scale;
    g.rotation = amplitude * vec3(b[1][2], b[2][0], b[0][1]) * (ratio - 1.0 / ratio);
    g.opacity_logit = amplitude * (1.0 - opacity) * s0;
    g.intensity = amplitude * c0;
    gradients[i] = g;
}
