// A volume in an image, and the bricks that empty space is leapt over by. Places count in voxels from the
// centre of the image's first one; brick 0 begins one voxel before that.
#ifndef BRICKS_GLSL
#define BRICKS_GLSL
#extension GL_EXT_scalar_block_layout : require

// See types.rs.
struct BrickGrid {
    uvec3 texels;
    uvec3 bricks;
    uvec3 shift;
};

uint brick_index(BrickGrid g, uvec3 brick) {
    return (brick.z * g.bricks.y + brick.y) * g.bricks.x + brick.x;
}

#endif
