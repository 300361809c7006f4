#version 460
// One step of Adam for the coefficients of the harmonics. An invocation has those of a splat. A step whose pairs
// found no room is void, as in adam.comp.
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform AdamHarmonicsParams {
    uint splat_count;
    uint coefficients; // of a splat
    uint capacity;     // pairs that there is room for
    float beta1;
    float beta2;
    float correction1;
    float correction2;
    float epsilon;
    float rate;        // of the first of a splat
    float rate_rest;   // of the others
} p;
layout(scalar, binding = 0) readonly buffer HarmonicGradients { vec3 harmonic_gradients[]; };
layout(scalar, binding = 1) buffer Harmonics { vec3 harmonics_of[]; };
layout(scalar, binding = 2) buffer First { vec3 first_moments[]; };
layout(scalar, binding = 3) buffer Second { vec3 second_moments[]; };
layout(scalar, binding = 4) readonly buffer PairTotals { uint pair_totals[]; };

void main() {
    uint splat = gl_GlobalInvocationID.x;
    if (splat >= p.splat_count || pair_totals[0] > p.capacity) return;
    for (uint k = 0; k < p.coefficients; ++k) {
        uint i = splat * p.coefficients + k;
        vec3 g = harmonic_gradients[i];
        if (!(dot(g, g) < 1e37)) continue;
        vec3 m = p.beta1 * first_moments[i] + (1.0 - p.beta1) * g;
        vec3 v = p.beta2 * second_moments[i] + (1.0 - p.beta2) * g * g;
        first_moments[i] = m;
        second_moments[i] = v;
        float rate = k == 0 ? p.rate : p.rate_rest;
        harmonics_of[i] -= rate * (m * p.correction1) / (sqrt(v * p.correction2) + p.epsilon);
    }
}
