#version 460
// Corrects extinction and colour of each splat by the ratios at the points that it draws at. One invocation owns
// a splat.
#include "deconvolution.glsl"
layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer SplatEnds { uint splat_ends[]; };
layout(scalar, binding = 1) readonly buffer SplatPairs { uint splat_pairs[]; };
layout(scalar, binding = 2) readonly buffer Shares { float shares[]; };
layout(scalar, binding = 3) readonly buffer Ratios { uvec2 ratios[]; };
layout(scalar, binding = 4) buffer Media { vec4 media[]; };
layout(scalar, binding = 5) writeonly buffer MediaHalves { uvec2 media_halves[]; };

const float LEAST_MEDIUM = 1e-7;
// A round multiplies by no less and no more.
const float LEAST_FACTOR = 0.05;
const float MOST_FACTOR = 8.0;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.count) return;
    // A splat that is to draw nothing anywhere is done.
    if (p.round > 0 && media[i].a == 0.0) return;
    vec4 sum = vec4(0.0);
    float whole = 0.0;
    uint end = splat_ends[i];
    for (uint k = i == 0 ? 0 : splat_ends[i - 1]; k < end; ++k) {
        uint pair = splat_pairs[k];
        float weight = pair_weight(pair);
        sum += weight * from_halves(ratios[pair >> 8]);
        whole += weight;
    }
    vec4 mean = sum / max(whole, 1.0);
    vec4 medium;
    if (p.round == 0) {
        medium = mean.a > 0.0 ? max(shares[i] * mean, LEAST_MEDIUM) : vec4(0.0);
    } else {
        vec4 factor = clamp(mean, LEAST_FACTOR, MOST_FACTOR);
        medium = media[i] * (p.round < ROUNDS ? factor * factor : factor);
    }
    media[i] = medium;
    media_halves[i] = in_halves(medium);
}
