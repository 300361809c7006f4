#version 460
// Triangles of egui on planes in the room, as both eyes see them: a point of the screen is a place on the
// plane of its row. Behind an eye, and nearer than the range of depths, nothing is drawn.
#extension GL_EXT_multiview : require
#include "panels.glsl"
#include "projection.glsl"
#include "sheets.glsl"
layout(push_constant, scalar) uniform SheetsParams {
    vec2 range; // as in eyes.glsl
} p;
layout(scalar, binding = 0) readonly buffer Vertices { PanelVertex vertices[]; };
layout(scalar, binding = 1) readonly buffer Indices { uint indices[]; };
layout(scalar, binding = 2) readonly buffer Sheets { Sheet sheets[]; };
layout(scalar, binding = 4) readonly buffer Views { View views[]; };
layout(location = 0) out vec2 place;
layout(location = 1) out vec2 texel;
layout(location = 2) out vec4 colour;
layout(location = 3) flat out vec4 clip;

void main() {
    PanelVertex vertex = vertices[indices[gl_VertexIndex]];
    Sheet sheet = sheets[vertex.clip];
    View view = views[gl_ViewIndex];
    place = vertex.place;
    texel = vertex.texel;
    colour = unpackUnorm4x8(vertex.colour);
    clip = sheet.clip;
    vec3 at = sheet.zero + place.x * sheet.right + place.y * sheet.down;
    gl_Position = projected_place(view, at, p.range);
}
