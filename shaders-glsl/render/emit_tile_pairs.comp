#version 460
// Writes a pair for each (tile, block) that a projected splat reaches: the key is view, tile and block, the
// value the splat's row and in its upper 8 bits the parts of the tile. One invocation owns a splat and the
// run of pairs that the prefix sum gave it; pairs behind the capacity are dropped (the host sees the total
// and renders again).
#include "kernel.glsl"
#include "tiles.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 1) const uint HIDDEN = 0; // 1: parts of tiles that no eye sees get no pairs
layout(push_constant, scalar) uniform EmitParams { TileGrid grid; } p;
layout(scalar, binding = 0) readonly buffer Views { View views[]; };
layout(scalar, binding = 1) readonly buffer ProjectedRows { Projected projected[]; };
layout(scalar, binding = 2) readonly buffer Boxes { uvec4 boxes[]; };
layout(scalar, binding = 3) readonly buffer PairOffsets { uint pair_offsets[]; };
layout(scalar, binding = 4) writeonly buffer Keys { uint keys[]; };
layout(scalar, binding = 5) writeonly buffer Values { uint values[]; };
layout(scalar, binding = 6) readonly buffer HiddenParts { uint hidden_parts[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.grid.splat_count) return;
    uint row = gl_WorkGroupID.y * p.grid.splat_count + i;
    uint at = pair_offsets[row];
    if (at == pair_offsets[row + 1]) return;
    View v = views[gl_WorkGroupID.y];
    Projected s = projected[row];
    uvec4 box = boxes[row];
    ivec2 blocks = block_range(p.grid, first_depth(p.grid, v), s.depth, s.reach);
    float g = outline(support_q(), s.depth, s.reach);
    for (uint ty = box.y; ty < box.w; ++ty)
        for (uint tx = box.x; tx < box.z; ++tx) {
            uint tile = (gl_WorkGroupID.y * p.grid.tiles.y + ty) * p.grid.tiles.x + tx;
            uint hidden = 0;
            if (HIDDEN == 1) hidden = hidden_parts[tile];
            if (HIDDEN == 1 && hidden == (1u << PARTS) - 1) continue;
            uint parts = tile_parts(p.grid, v, s, uvec2(tx, ty), g) & ~hidden;
            if (parts == 0) continue;
            for (int block = blocks.x; block <= blocks.y; ++block) {
                if (at < p.grid.capacity) {
                    keys[at] = tile * p.grid.blocks + uint(block);
                    values[at] = row | parts << ROW_BITS;
                }
                at += 1;
            }
        }
}
