#version 460
// Turns the masks of pairs (which cells does this pair reach) into masks of cells (which pairs reach this cell): for
// every 32 pairs of a brick a block of 64 words, one a cell, bit j for pair j. One workgroup owns a brick, one invocation a
// cell. The blocks of a slot begin at `mask_block`.
#include "splat.glsl"
#include "brick.glsl"
layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 1) readonly buffer PairMasks { uvec2 pair_masks[]; };
layout(scalar, binding = 2) writeonly buffer CellMasks { uint cell_masks[]; };

void main() {
    uint slot = gl_WorkGroupID.x;
    uint cell = gl_LocalInvocationIndex;
    uint start = starts[slot];
    uint end = starts[slot + 1];
    uint to = mask_block(start, slot) * 64 + cell;
    for (uint i = start; i < end; i += 32) {
        uint word = 0;
        uint count = min(end - i, 32);
        for (uint j = 0; j < count; ++j) {
            uvec2 mask = pair_masks[i + j];
            word |= (((cell < 32 ? mask.x : mask.y) >> (cell & 31u)) & 1u) << j;
        }
        cell_masks[to] = word;
        to += 64;
    }
}
