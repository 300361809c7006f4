#version 460
// For each voxel of a volume or an atlas twice the gradient of O (V - dark) in voxel space, by central differences over a
// voxel on each side, O as far as the opacities of objects leave it. V counts as a fraction, and gradients by `unit`, so
// that they fit 16-bit floats whatever the intensities are.
//
// One workgroup owns a brick: of an atlas one of its own with its apron, of a dense image 8^3 voxels.
#define MEDIUM_BINDING 2
#include "medium.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform VoxelGradientParams {
    BrickGrid grid;
    float dark; // as a fraction
    float unit;
} p;
// Coordinates of the brick of the grid that lies at each place of the atlas, and its level; x is NOWHERE at a place without one.
layout(scalar, binding = 0) readonly buffer BrickAt { uvec4 brick_at[]; };
layout(binding = 1) writeonly uniform image3D gradients;

const uint NOWHERE = ~0u;
// Along each axis of the excess that is shared: a brick with its apron, and one voxel on each side.
const int SHARED = 11;

shared float excess[SHARED * SHARED * SHARED];

ivec3 cube_place(uint i, uint edge) {
    return ivec3(i % edge, i / edge % edge, i / (edge * edge));
}

void main() {
    uvec3 at = gl_WorkGroupID;
    uint edge = 8;
    uvec3 texel = at * 8;
    ivec3 voxel = ivec3(texel);
    int stride = 1; // voxels from texel to texel
    if (ATLAS != 0) {
        edge = APRONED;
        uvec3 across = textureSize(medium, 0) / APRONED;
        uvec4 brick = brick_at[(at.z * across.y + at.y) * across.x + at.x];
        if (brick.x == NOWHERE) return;
        texel = at * APRONED;
        voxel = ivec3(brick.xyz * 8) - 1;
        stride = 1 << brick.w;
    }
    uint wide = edge + 2;
    for (uint i = gl_LocalInvocationIndex; i < wide * wide * wide; i += gl_WorkGroupSize.x) {
        excess[i] = excess_of(p.grid, voxel + stride * (cube_place(i, wide) - 1), p.dark);
    }
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < edge * edge * edge; i += gl_WorkGroupSize.x) {
        ivec3 place = cube_place(i, edge);
        bool beyond = any(greaterThanEqual(ivec3(texel) + place, textureSize(medium, 0)));
        if (beyond) continue;
        uvec3 next = uvec3(1, wide, wide * wide);
        uint centre = (uint(place.z + 1) * wide + uint(place.y + 1)) * wide + uint(place.x + 1);
        vec3 slopes;
        for (int axis = 0; axis < 3; ++axis) {
            slopes[axis] = excess[centre + next[axis]] - excess[centre - next[axis]];
        }
        imageStore(gradients, ivec3(texel) + place, vec4(p.unit / float(stride) * slopes, 0.0));
    }
}
