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
layout(scalar, binding = 6) writeonly buffer Cells { uvec2 cells[]; };

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
        for (int y = first.y; y <= last.y; ++y) {
            float x0, x1;
            if (!row_interval(f, float(y) - mean.y, float(z) - mean.z, mean.x, support, x0, x1)) continue;
            // Widened like the box: a cell too many costs a little, a cell too few is wrong.
            int a = max(int(ceil(clamp(x0 - 1e-3, -1e6, 1e6))), first.x);
            int b = min(int(floor(clamp(x1 + 1e-3, -1e6, 1e6))), last.x);
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
    cells[i] = mask & active_cells[slot];
}
