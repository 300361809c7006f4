#version 460
// Which of the 64 cells (2^3 samples) of its brick each pair's ellipsoid reaches, by the interval of every row; only
// cells with samples that take part. Two words a pair: cells 0..32 and 32..64 in Morton order.
// One invocation owns a pair.
#include "splat.glsl"
#include "kernel.glsl"
#include "brick.glsl"
layout(local_size_x = 256) in;
layout(push_constant, scalar) uniform PairParams { Grid grid; uint count_index; uint capacity; } p;
layout(scalar, binding = 0) readonly buffer Counts { uint counts[]; };
layout(scalar, binding = 1) readonly buffer Keys { uint keys[]; };
layout(scalar, binding = 2) readonly buffer Values { uint values[]; };
layout(scalar, binding = 3) readonly buffer Footprints { Footprint footprints[]; };
layout(scalar, binding = 4) readonly buffer BrickCoordinates { uvec3 brick_coordinates[]; };
layout(scalar, binding = 5) readonly buffer ActiveCells { uvec2 active_cells[]; };
layout(scalar, binding = 6) writeonly buffer PairMasks { uvec2 pair_masks[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= min(counts[p.count_index], p.capacity)) return;
    uint slot = keys[i] + p.grid.first_slot;
    Footprint f = footprints[values[i]];
    ivec3 corner = ivec3(brick_coordinates[slot] * 8u);
    ivec3 first, last;
    sample_box(f, p.grid, first, last);
    first = max(first, corner);
    last = min(last, corner + 7);
    float support = support_q();
    vec3 mean = f.mean - p.grid.offset;
    uvec2 mask = uvec2(0);
    for (int z = first.z; z <= last.z; ++z) {
        Plane plane = plane_at(f, float(z) - mean.z, support);
        float y0, y1;
        if (!plane_rows(f, plane, mean.y, y0, y1)) continue;
        ivec2 rows = indices(y0, y1, first.y, last.y);
        for (int y = rows.x; y <= rows.y; ++y) {
            float x0, x1;
            row_interval(f, plane, float(y) - mean.y, mean.x, x0, x1);
            ivec2 row_x = indices(x0, x1, first.x, last.x);
            int a = row_x.x, b = row_x.y;
            if (a > b) continue;
            // Cells ca..=cb along x stand at bits 0, 1, 8, 9 in Morton order.
            uint ca = uint(a - corner.x) >> 1, cb = uint(b - corner.x) >> 1;
            uint row = (0xFu >> (3u - cb)) & (0xFu << ca);
            row = (row & 3u) | ((row & 12u) << 6);
            uint cy = uint(y - corner.y) >> 1, cz = uint(z - corner.z) >> 1;
            row <<= ((cy & 1u) << 1) | ((cz & 1u) << 2) | ((cy & 2u) << 3);
            if ((cz & 2u) == 0) mask.x |= row;
            else mask.y |= row;
        }
    }
    pair_masks[i] = mask & active_cells[slot];
}
