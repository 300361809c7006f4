#version 460
// How many splats reach each cell (2^3 samples): the pairs of its brick that have the cell's bit. One workgroup owns a
// brick, one invocation a cell.
#include "splat.glsl"
layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 1) readonly buffer Cells { uvec2 cells[]; };
layout(scalar, binding = 2) writeonly buffer CellCounts { uint cell_counts[]; };

void main() {
    uint slot = gl_WorkGroupID.x;
    uint cell = gl_LocalInvocationIndex;
    uint count = 0;
    uint end = starts[slot + 1];
    for (uint i = starts[slot]; i < end; ++i) {
        uvec2 mask = cells[i];
        count += ((cell < 32 ? mask.x : mask.y) >> (cell & 31u)) & 1u;
    }
    cell_counts[slot * 64 + cell] = count;
}
