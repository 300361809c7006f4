#version 460
// Lists the splats that reach each cell, in splat order, so that a cell's samples add the same numbers in the same order
// in every run. One workgroup owns a brick, one invocation a cell and the part of the list that the prefix sum of
// cell_counts gave it. Entries behind the capacity are dropped (the host sees the total and repeats the step).
#include "splat.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform CellParams { uint capacity; } p;
layout(scalar, binding = 0) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 1) readonly buffer Values { uint values[]; };
layout(scalar, binding = 2) readonly buffer Cells { uvec2 cells[]; };
layout(scalar, binding = 3) readonly buffer ListStarts { uint list_starts[]; };
layout(scalar, binding = 4) writeonly buffer Lists { uint lists[]; };

void main() {
    uint slot = gl_WorkGroupID.x;
    uint cell = gl_LocalInvocationIndex;
    uint at = list_starts[slot * 64 + cell];
    uint end = starts[slot + 1];
    for (uint i = starts[slot]; i < end; ++i) {
        uvec2 mask = cells[i];
        if ((((cell < 32 ? mask.x : mask.y) >> (cell & 31u)) & 1u) != 0) {
            if (at < p.capacity) lists[at] = values[i];
            at += 1;
        }
    }
}
