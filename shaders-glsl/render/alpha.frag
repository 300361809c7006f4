#version 460
// A splat where a ray crosses it.
#include "alpha.glsl"
layout(location = 0) in vec2 place;
layout(location = 1) flat in vec4 colour;
layout(location = 0) out vec4 result;

void main() {
    float opacity = opacity_at(place, colour.a);
    if (COUNTING == 1) {
        result = counted(opacity);
        return;
    }
    if (opacity == 0.0) discard;
    result = vec4(colour.rgb, 1.0) * opacity;
}
