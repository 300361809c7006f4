#version 460
// Lists the faces around what a look can show (faces.glsl), in whatever order. One invocation owns a cube.
#include "faces.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform FacesParams { BrickGrid grid; } p;
layout(scalar, binding = 0) readonly buffer Distances { uint distances[]; };
layout(scalar, binding = 1) writeonly buffer Faces { uint faces[]; };
layout(scalar, binding = 2) buffer Arguments { uint arguments[]; }; // of their drawing; zeros at first

bool shown(ivec3 cube, ivec3 cubes) {
    if (any(lessThan(cube, ivec3(0))) || any(greaterThanEqual(cube, cubes))) return false;
    uvec3 low = uvec3(cube) * CUBE, high = min(low + CUBE, p.grid.bricks);
    for (uint z = low.z; z < high.z; ++z)
        for (uint y = low.y; y < high.y; ++y)
            for (uint x = low.x; x < high.x; ++x)
                if (distances[brick_index(p.grid, uvec3(x, y, z))] == 0) return true;
    return false;
}

void main() {
    int i = int(gl_GlobalInvocationID.x);
    ivec3 cubes = ivec3(cube_count(p.grid));
    if (i == 0) arguments[1] = 1;
    if (i >= cubes.x * cubes.y * cubes.z) return;
    ivec3 cube = ivec3(i % cubes.x, i / cubes.x % cubes.y, i / (cubes.x * cubes.y));
    if (!shown(cube, cubes)) return;
    for (uint face = 0; face < 6; ++face) {
        ivec3 behind = cube;
        behind[face >> 1] += (face & 1u) == 1u ? 1 : -1;
        if (!shown(behind, cubes)) faces[atomicAdd(arguments[0], 6u) / 6u] = 6u * uint(i) + face;
    }
}
