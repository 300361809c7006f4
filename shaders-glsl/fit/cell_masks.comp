#version 460
// Turns the masks of pairs (which cells does this pair reach) into masks of cells (which pairs reach this
// cell): for every 32 pairs of a brick a block of 64 words, one a cell, bit j for pair j. The blocks of a
// slot begin at `mask_block`. One workgroup owns a brick; an invocation takes 32 pairs and 8 cells at a time,
// as four transpositions of 8 by 8 bits (Warren, Hacker's Delight, 7-3).
#include "splat.glsl"
#include "brick.glsl"
layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 1) readonly buffer PairMasks { uint pair_masks[]; }; // [pair][2]
layout(scalar, binding = 2) writeonly buffer CellMasks { uint cell_masks[]; };

// Byte r of (low, high) is row r; afterwards byte c holds bit c of every row.
uvec2 transpose8(uvec2 m) {
    uvec2 t = (m ^ (m >> 7)) & 0x00AA00AAu;
    m ^= t ^ (t << 7);
    t = (m ^ (m >> 14)) & 0x0000CCCCu;
    m ^= t ^ (t << 14);
    uint u = (m.x ^ (m.y << 4)) & 0xF0F0F0F0u;
    return uvec2(m.x ^ u, m.y ^ (u >> 4));
}

void main() {
    uint slot = gl_WorkGroupID.x;
    uint start = starts[slot];
    uint end = starts[slot + 1];
    uint block = mask_block(start, slot);
    uint tasks = (end - start + 31) / 32 * 8;
    for (uint task = gl_LocalInvocationIndex; task < tasks; task += 64) {
        uint octet = task & 7u; // which 8 cells
        uint first = start + (task >> 3) * 32;
        uint byte_shift = (octet & 3u) * 8;
        uint words[8] = uint[8](0, 0, 0, 0, 0, 0, 0, 0);
        for (uint k = 0; k < 4; ++k) {
            uvec2 rows = uvec2(0);
            for (uint r = 0; r < 4; ++r) {
                uint i = first + k * 8 + r;
                if (i < end) rows.x |= ((pair_masks[i * 2 + (octet >> 2)] >> byte_shift) & 0xFFu) << (r * 8);
                if (i + 4 < end) rows.y |= ((pair_masks[i * 2 + 8 + (octet >> 2)] >> byte_shift) & 0xFFu) << (r * 8);
            }
            uvec2 columns = transpose8(rows);
            for (uint c = 0; c < 4; ++c) {
                words[c] |= ((columns.x >> (c * 8)) & 0xFFu) << (k * 8);
                words[c + 4] |= ((columns.y >> (c * 8)) & 0xFFu) << (k * 8);
            }
        }
        uint to = (block + (task >> 3)) * CELLS + octet * 8;
        for (uint c = 0; c < 8; ++c) cell_masks[to + c] = words[c];
    }
}
