// What the shaders of mode alpha share: their constants, and the opacity of a splat where a ray crosses it.
#ifndef ALPHA_GLSL
#define ALPHA_GLSL
#include "quad.glsl"

// Corners of a splat: 6 are a square of two triangles, 3 a triangle around the ellipse. That has 1.3 times
// the area and half the triangles, which is better where setting up a triangle costs more than filling it: on
// CPU drivers.
layout(constant_id = 0) const uint CORNERS = 6;
layout(constant_id = 1) const uint STANDARD = 0; // 1: standard splats
layout(constant_id = 2) const uint COUNTING = 0; // 1: the picture shows work instead of colours

// What is added to a pixel where work is counted: the fragment, and whether it is blended.
vec4 counted(float opacity) {
    return vec4(1.0, opacity > 0.0 ? 1.0 : 0.0, 0.0, 0.0);
}

// `place` is where the ray is, γ = 6 |place|². 0 outside the ellipse.
float opacity_at(vec2 place, float thickness) {
    float r = dot(place, place);
    if (STANDARD == 1) {
        float opacity = min(thickness * exp(-3.0 * r), MOST_OPACITY);
        return opacity < LEAST_OPACITY ? 0.0 : opacity;
    }
    float t = max(1.0 - r, 0.0);
    float thick = thickness * t * t;
    return thick < LEAST_DEPTH ? 0.0 : 1.0 - exp(-thick);
}

#endif
