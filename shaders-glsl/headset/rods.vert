#version 460
// Rods in the room, as both eyes see them.
#extension GL_EXT_multiview : require
#include "projection.glsl"
#include "rods.glsl"
layout(push_constant, scalar) uniform RodsParams {
    vec2 range; // as in eyes.glsl
} p;
layout(scalar, binding = 0) readonly buffer Rods { Rod rods[]; };
layout(scalar, binding = 1) readonly buffer Views { View views[]; };
layout(location = 0) out vec3 colour;
layout(location = 1) out float facing; // cosine from the surface to the eye

const float TURN = 6.2831853;

void main() {
    Rod rod = rods[gl_VertexIndex / CORNERS];
    uint corner = gl_VertexIndex % CORNERS, quad = corner / 6u, k = corner % 6u;
    // Two triangles of a quad: 0 1 2 and 2 1 3, where bit 0 goes round the rod and bit 1 along it.
    uint bits = k < 3u ? k : (k == 3u ? 2u : k == 4u ? 1u : 3u);
    float turn = TURN * float(quad % SIDES + (bits & 1u)) / float(SIDES);
    uint ring = quad / SIDES + (bits >> 1);
    bool at_end = ring > BANDS / 2u;
    // Rings lie at -90, -45 and 0 degrees of the first half sphere, and at 0, 45 and 90 of the other.
    float height = TURN / 8.0 * (float(ring) - (at_end ? 3.0 : 2.0));
    vec3 along = rod.to - rod.from;
    vec3 axis = dot(along, along) > 0.0 ? normalize(along) : vec3(0.0, 0.0, 1.0);
    vec3 across = normalize(cross(axis, abs(axis.x) < 0.7 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0)));
    vec3 around = cos(turn) * across + sin(turn) * cross(axis, across);
    vec3 normal = cos(height) * around + sin(height) * axis;
    vec3 at = at_end ? rod.to + rod.radii.y * normal : rod.from + rod.radii.x * normal;
    View view = views[gl_ViewIndex];
    colour = unpackUnorm4x8(rod.colour).rgb;
    facing = dot(normal, normalize(view.eye - at));
    gl_Position = projected_place(view, at, p.range);
}
