#version 460
// Compares what splats draw with the medium, at points. One invocation owns a point. In round 0 the ratio is
// the medium itself, from which splats begin.
#define LOOK_BINDING 0
#include "look_table.glsl"
#include "deconvolution.glsl"
layout(local_size_x = 64) in;
layout(scalar, binding = 3) readonly buffer PointValues { vec2 point_values[]; }; // V and O
layout(scalar, binding = 4) readonly buffer PointEnds { uint point_ends[]; };
layout(scalar, binding = 5) readonly buffer PointPairs { uint point_pairs[]; };
layout(scalar, binding = 6) readonly buffer MediaHalves { uvec2 media_halves[]; }; // extinction times colour, extinction, 1/mm
layout(scalar, binding = 7) writeonly buffer Ratios { uvec2 ratios[]; };

// Greatest extinction, 1/mm: what is denser looks the same, but would spread over neighbours that it hides.
const float MOST_EXTINCTION = 0.7;
// Least that counts as drawn, 1/mm, and the greatest ratio.
const float LEAST_DRAWN = 1e-9;
const float MOST_RATIO = 64.0;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.count) return;
    vec2 value = point_values[i];
    vec4 look = look_point(0u, value.x);
    float extinction = min(-log(1.0 - value.y * (1.0 - exp(-look.a))), MOST_EXTINCTION);
    vec4 ratio = vec4(look.rgb, 1.0) * extinction;
    // What is to be nothing is nothing whatever is drawn, and its list need not be read.
    if (p.round > 0 && extinction > 0.0) {
        vec4 drawn = vec4(0.0);
        uint end = point_ends[i];
        for (uint k = i == 0 ? 0 : point_ends[i - 1]; k < end; ++k) {
            uint pair = point_pairs[k];
            drawn += pair_weight(pair) * from_halves(media_halves[pair >> 8]);
        }
        ratio = min(ratio / max(drawn * (1.0 / 255.0), LEAST_DRAWN), MOST_RATIO);
    }
    ratios[i] = in_halves(ratio);
}
