#version 460
// Which of the 64 cells (2^3 samples) of its brick each pair's ellipsoid reaches, by the interval of every
// row; only cells with samples that take part. Two words a pair: cells 0..32 and 32..64 in Morton order. One
// invocation owns a pair.
#include "splat.glsl"
#include "kernel.glsl"
#include "brick.glsl"
layout(local_size_x = 256) in;
layout(push_constant, scalar) uniform PairParams { Grid grid; uint count_index; uint capacity; } p;
layout(scalar, binding = 0) readonly buffer PairOffsets { uint pair_offsets[]; };
layout(scalar, binding = 1) readonly buffer Keys { uint keys[]; };
layout(scalar, binding = 2) readonly buffer PairSplats { uint pair_splats[]; };
layout(scalar, binding = 3) readonly buffer Footprints { Footprint footprints[]; };
layout(scalar, binding = 4) readonly buffer BrickCoordinates { uvec3 brick_coordinates[]; };
layout(scalar, binding = 5) readonly buffer ActiveCells { uvec2 active_cells[]; };
layout(scalar, binding = 6) writeonly buffer PairMasks { uint pair_masks[]; }; // [pair][2]

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= min(pair_offsets[p.count_index], p.capacity)) return;
    uint slot = keys[i] + p.grid.first_slot;
    Footprint f = footprints[pair_splats[i]];
    ivec3 corner = ivec3(brick_coordinates[slot] * 8u);
    float support = support_q();
    vec3 mean = f.mean - p.grid.offset - vec3(corner); // in the brick
    // Rows of cells: four rows of samples each, cut by the ellipsoid one by one.
    ivec2 rows_y = indices(mean.y - f.extent.y, mean.y + f.extent.y, 0, 7) >> 1;
    ivec2 rows_z = indices(mean.z - f.extent.z, mean.z + f.extent.z, 0, 7) >> 1;
    ivec2 columns = ivec2(0, 7);
    if (KERNEL == KERNEL_GATED) columns = indices(mean.x - f.extent.x, mean.x + f.extent.x, 0, 7);
    float inverse = 1.0 / f.t_x.x;
    vec2 slope = f.t_x.yz * inverse;
    uvec2 mask = uvec2(0);
    for (int cz = rows_z.x; cz <= rows_z.y; ++cz) {
        vec2 dz = vec2(cz * 2, cz * 2 + 1) - mean.z;
        vec2 rest_z = support - f.t_z * f.t_z * dz * dz;
        for (int cy = rows_y.x; cy <= rows_y.y; ++cy) {
            vec2 dy = vec2(cy * 2, cy * 2 + 1) - mean.y;
            vec4 ys = dy.xyxy, zs = dz.xxyy;
            vec4 v = f.t_y.x * ys + f.t_y.y * zs;
            vec4 rest = rest_z.xxyy - v * v;
            vec4 half_width = sqrt(max(rest, 0.0)) * inverse;
            vec4 middle = mean.x - slope.x * ys - slope.y * zs;
            vec4 from = mix(vec4(1e6), middle - half_width, greaterThan(rest, vec4(0.0)));
            vec4 to = mix(vec4(-1e6), middle + half_width, greaterThan(rest, vec4(0.0)));
            ivec2 x = indices(min(min(from.x, from.y), min(from.z, from.w)),
                              max(max(to.x, to.y), max(to.z, to.w)), columns.x, columns.y);
            // Cells ca..=cb along x stand at bits 0, 1, 8, 9 in Morton order.
            uint ca = uint(x.x) >> 1, cb = uint(x.y) >> 1;
            uint row = x.x > x.y ? 0u : (0xFu >> (3u - cb)) & (0xFu << ca);
            row = (row & 3u) | ((row & 12u) << 6);
            uint shift = ((uint(cy) & 1u) << 1) | ((uint(cz) & 1u) << 2) | ((uint(cy) & 2u) << 3);
            if (cz < 2) mask.x |= row << shift;
            else mask.y |= row << shift;
        }
    }
    mask &= active_cells[slot];
    pair_masks[i * 2] = mask.x;
    pair_masks[i * 2 + 1] = mask.y;
}
