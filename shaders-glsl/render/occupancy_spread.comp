#version 460
// One axis of the Chebyshev distance from each brick to the nearest that can be seen: the least max(|d|,
// distance of the brick d further along the axis). Once along x, y and z makes it whole. One invocation owns
// a brick.
#include "bricks.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(push_constant, scalar) uniform SpreadParams { BrickGrid grid; uint axis; } p;
layout(scalar, binding = 0) readonly buffer Before { uint before[]; };
layout(scalar, binding = 1) writeonly buffer After { uint after[]; };

void main() {
    uvec3 brick = gl_GlobalInvocationID;
    uvec3 n = p.grid.bricks;
    if (any(greaterThanEqual(brick, n))) return;
    uint i = brick_index(p.grid, brick);
    uint stride = uvec3(1, n.x, n.x * n.y)[p.axis];
    uint place = brick[p.axis];
    uint behind = n[p.axis] - 1 - place;
    uint nearest = before[i];
    // What is d away can only help while d is less than the best so far.
    for (uint d = 1; d < nearest; ++d) {
        if (d > place && d > behind) break;
        if (d <= place) nearest = min(nearest, max(d, before[i - d * stride]));
        if (d <= behind) nearest = min(nearest, max(d, before[i + d * stride]));
    }
    after[i] = nearest;
}
