#version 460
// Triangles of the panels, as egui makes them.
#include "panels.glsl"
layout(push_constant, scalar) uniform PanelParams {
    vec2 window; // points
} p;
layout(scalar, binding = 0) readonly buffer Vertices { PanelVertex vertices[]; };
layout(scalar, binding = 1) readonly buffer Indices { uint indices[]; };
layout(scalar, binding = 2) readonly buffer Clips { vec4 clips[]; }; // left, top, right, bottom; points
layout(location = 0) out vec2 place;
layout(location = 1) out vec2 texel;
layout(location = 2) out vec4 colour;
layout(location = 3) flat out vec4 clip;

void main() {
    PanelVertex vertex = vertices[indices[gl_VertexIndex]];
    place = vertex.place;
    texel = vertex.texel;
    colour = unpackUnorm4x8(vertex.colour);
    clip = clips[vertex.clip];
    gl_Position = vec4(place / p.window * 2.0 - 1.0, 0.0, 1.0);
}
