#version 460
// Corrects extinction and colour of each splat by the ratios at the points that it draws at. One invocation owns
// a splat.
#include "deconvolution.glsl"
layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer SplatEnds { uint splat_ends[]; };
layout(scalar, binding = 1) readonly buffer SplatPairs { uint splat_pairs[]; };
layout(scalar, binding = 2) readonly buffer Beginnings { vec2 beginnings[]; }; // the share, and 1 / Σ profile volume
layout(scalar, binding = 3) readonly buffer Ratios { vec4 ratios[]; }; // times the volume of the point
layout(scalar, binding = 4) buffer Media { vec4 media[]; };

// Rounds after the first. Each but the last one goes twice as far as Richardson and Lucy do.
const uint ROUNDS = 5;
const float LEAST_MEDIUM = 1e-7;
// A round multiplies by no less and no more.
const float LEAST_FACTOR = 0.05;
const float MOST_FACTOR = 8.0;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.count) return;
    vec4 sum = vec4(0.0);
    uint end = splat_ends[i];
    for (uint k = i == 0 ? 0 : splat_ends[i - 1]; k < end; ++k) {
        uint pair = splat_pairs[k];
        sum += pair_profile(pair) * ratios[pair >> 8];
    }
    vec2 beginning = beginnings[i];
    vec4 mean = sum * beginning.y;
    if (p.round == 0) {
        media[i] = max(beginning.x * mean, LEAST_MEDIUM);
        return;
    }
    vec4 factor = clamp(mean, LEAST_FACTOR, MOST_FACTOR);
    media[i] *= p.round < ROUNDS ? factor * factor : factor;
}
