#version 460
// The corners of the splats' quads, back to front. Each view takes its own row of a splat.
#extension GL_EXT_multiview : require
#include "alpha.glsl"
layout(push_constant, scalar) uniform AlphaParams { uint splat_count; } p;
layout(scalar, binding = 0) readonly buffer Quads { Quad quads[]; };
layout(scalar, binding = 1) readonly buffer Order { uint order[]; };
// Linear on the picture, because w is 1. `noperspective` would say the same, but lavapipe (Mesa 25.0)
// interpolates that wrongly in triangles that it has to clip: splats larger than the picture lost their
// opacity.
layout(location = 0) out vec2 place;
layout(location = 1) flat out vec4 colour; // and the thickness
layout(location = 2) flat out float depth;

const vec2 SQUARE[6] = vec2[](vec2(-1, -1), vec2(1, -1), vec2(-1, 1), vec2(-1, 1), vec2(1, -1), vec2(1, 1));
const vec2 TRIANGLE[3] = vec2[](vec2(0, 2), vec2(1.7320508, -1), vec2(-1.7320508, -1));

void main() {
    uint at = uint(gl_VertexIndex) / CORNERS;
    uint corner = uint(gl_VertexIndex) - at * CORNERS;
    Quad quad = quads[uint(gl_ViewIndex) * p.splat_count + order[at]];
    if (CORNERS == 3) place = TRIANGLE[corner];
    else place = SQUARE[corner];
    place *= quad.edge;
    colour = vec4(quad.colour, quad.thickness);
    depth = quad.depth;
    gl_Position = vec4(quad.centre + vec2(dot(quad.axes.xy, place), quad.axes.z * place.y), 0.0, 1.0);
}
