#version 460
// A splat where a ray crosses it, with its depth.
#include "alpha.glsl"
layout(location = 0) noperspective in vec2 place;
layout(location = 1) flat in vec4 colour;
layout(location = 2) flat in float depth;
layout(location = 0) out vec4 result;
layout(location = 1) out vec4 weighted_depth; // in the first channel; the last one blends

void main() {
    float opacity = opacity_at(place, colour.a);
    if (COUNTING == 1) {
        result = counted(opacity);
        weighted_depth = vec4(0.0);
        return;
    }
    if (opacity == 0.0) discard;
    result = vec4(colour.rgb, 1.0) * opacity;
    weighted_depth = vec4(depth, 0.0, 0.0, 1.0) * opacity;
}
