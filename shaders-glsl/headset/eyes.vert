#version 460
// A triangle over the whole picture of an eye.
#include "eyes.glsl"
layout(location = 0) noperspective out vec2 place; // 0 to 1 from the upper left corner

void main() {
    place = vec2(float(gl_VertexIndex & 1) * 2.0, float(gl_VertexIndex >> 1) * 2.0);
    gl_Position = vec4(place * 2.0 - 1.0, 0.0, 1.0);
}
