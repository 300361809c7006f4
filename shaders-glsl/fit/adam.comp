#version 460
// One step of Adam (Kingma & Ba 2015) for one splat an invocation, in voxel units, then the clamps. The
// rotation moves on the sphere: q <- normalise(q (1, ω/2)). A splat that is not finite, or whose gradient is not,
// is left as it is and counted. When a chunk of this step needed more room than the bins have, the step is void:
// nothing moves, the host repeats.
#include "splat.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform AdamParams {
    uint splat_count;
    uint chunk_count;
    uint capacity;      // pairs that fit the bins
    float beta1;
    float beta2;
    float correction1;  // 1 / (1 - beta1^t)
    float correction2;  // 1 / (1 - beta2^t)
    float epsilon;
    vec3 rate_mean;     // voxels
    float rate_rotation;// radians
    float rate_log_scale;
    float rate_opacity;
    float rate_intensity;
    vec3 min_log_scale; // along each of the splat's own axes
    vec3 max_log_scale;
    float scale_weight; // λ of Σ |s|, which pulls scales down; 0 leaves it out
    float max_logit;
    float min_intensity;
    float max_intensity;
    vec3 max_mean;      // means stay in -1/2 .. max_mean
} p;
layout(scalar, binding = 0) readonly buffer Gradients { SplatGrad gradients[]; };
layout(scalar, binding = 1) buffer Splats { Splat splats[]; };
layout(scalar, binding = 2) buffer First { SplatGrad first_moments[]; };
layout(scalar, binding = 3) buffer Second { SplatGrad second_moments[]; };
layout(scalar, binding = 4) readonly buffer PairTotals { uint pair_totals[]; }; // [chunk]
layout(scalar, binding = 5) buffer Frozen { uint frozen[]; };                   // [0]: splats left as they were
layout(scalar, binding = 6) buffer Histories { History histories[]; };

float moved(float g, inout float m, inout float v, float rate) {
    m = p.beta1 * m + (1.0 - p.beta1) * g;
    v = p.beta2 * v + (1.0 - p.beta2) * g * g;
    return -rate * (m * p.correction1) / (sqrt(v * p.correction2) + p.epsilon);
}

vec3 moved(vec3 g, inout vec3 m, inout vec3 v, vec3 rate) {
    m = p.beta1 * m + (1.0 - p.beta1) * g;
    v = p.beta2 * v + (1.0 - p.beta2) * g * g;
    return -rate * (m * p.correction1) / (sqrt(v * p.correction2) + p.epsilon);
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.splat_count) return;
    for (uint c = 0; c < p.chunk_count; ++c) if (pair_totals[c] > p.capacity) return;
    SplatGrad g = gradients[i];
    // The square must be finite too: it goes into the second moment.
    float size = dot(g.mean, g.mean) + dot(g.rotation, g.rotation) + dot(g.log_scale, g.log_scale)
        + g.opacity_logit * g.opacity_logit + g.intensity * g.intensity;
    Splat s = splats[i];
    // Not every driver's exp gives NaN for NaN, so that the gradient of a bad splat may look sound.
    float held = dot(s.mean, s.mean) + dot(s.rotation, s.rotation) + dot(s.log_scale, s.log_scale)
        + s.opacity_logit * s.opacity_logit + s.intensity * s.intensity;
    if (!(size < 1e37) || !(held < 1e37)) {
        atomicAdd(frozen[0], 1u);
        return;
    }
    if (p.scale_weight > 0.0) {
        vec3 scale = exp(s.log_scale);
        g.log_scale += p.scale_weight * scale * scale / length(scale);
    }
    SplatGrad m = first_moments[i];
    SplatGrad v = second_moments[i];
    s.mean = clamp(s.mean + moved(g.mean, m.mean, v.mean, p.rate_mean), vec3(-0.5), p.max_mean);
    vec3 o = 0.5 * moved(g.rotation, m.rotation, v.rotation, vec3(p.rate_rotation));
    vec4 q = s.rotation;
    q = vec4(q.x - dot(q.yzw, o), q.yzw + q.x * o + cross(q.yzw, o));
    s.rotation = q / length(q);
    vec3 most = min(p.max_log_scale, vec3(histories[i].log_scale_cap));
    s.log_scale = clamp(s.log_scale + moved(g.log_scale, m.log_scale, v.log_scale, vec3(p.rate_log_scale)),
                        min(p.min_log_scale, most), most);
    s.opacity_logit = clamp(s.opacity_logit + moved(g.opacity_logit, m.opacity_logit, v.opacity_logit, p.rate_opacity),
                            -p.max_logit, p.max_logit);
    s.intensity = clamp(s.intensity + moved(g.intensity, m.intensity, v.intensity, p.rate_intensity),
                        p.min_intensity, p.max_intensity);
    histories[i].gradient_norm += length(g.mean);
    splats[i] = s;
    first_moments[i] = m;
    second_moments[i] = v;
}
