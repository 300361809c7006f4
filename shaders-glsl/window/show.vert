#version 460
// A rectangle of the window, with a picture in it.
#include "show.glsl"
layout(location = 0) noperspective out vec2 place; // pixels of the window

const vec2 CORNERS[6] = vec2[](vec2(0, 0), vec2(1, 0), vec2(0, 1), vec2(0, 1), vec2(1, 0), vec2(1, 1));

void main() {
    place = mix(p.area.xy, p.area.zw, CORNERS[gl_VertexIndex]);
    gl_Position = vec4(place / p.window * 2.0 - 1.0, 0.0, 1.0);
}
