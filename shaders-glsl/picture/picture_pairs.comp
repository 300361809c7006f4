#version 460
// Writes a pair for each tile that a splat is drawn in: the key is the tile, the value the pair's own number. Splats come
// from front to back, and a stable sort keeps them so in each tile. One invocation owns a splat and the run of pairs that
// the prefix sum gave it; pairs behind the capacity are dropped (the host sees the total).
#include "picture.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform PicturePairParams { uvec2 size; uint splat_count; uint capacity; } p;
layout(scalar, binding = 0) readonly buffer Order { uint order[]; };
layout(scalar, binding = 1) readonly buffer PictureSplats { PictureSplat picture_splats[]; };
layout(scalar, binding = 2) readonly buffer PairOffsets { uint pair_offsets[]; }; // in that order
layout(scalar, binding = 3) writeonly buffer Keys { uint keys[]; };
layout(scalar, binding = 4) writeonly buffer Values { uint values[]; };
layout(scalar, binding = 5) writeonly buffer PairSplats { uint pair_splats[]; };

void main() {
    uint rank = gl_GlobalInvocationID.x;
    if (rank >= p.splat_count) return;
    uint at = pair_offsets[rank], end = min(pair_offsets[rank + 1], p.capacity);
    if (at >= end) return;
    uint i = order[rank];
    PictureSplat s = picture_splats[i];
    uint columns = (p.size.x + PICTURE_TILE - 1) / PICTURE_TILE;
    uvec4 box = picture_tiles(s, p.size);
    for (uint y = box.y; y < box.w; ++y)
        for (uint x = box.x; x < box.z; ++x) {
            if (!reaches_tile(s, uvec2(x, y))) continue;
            if (at < end) {
                keys[at] = y * columns + x;
                values[at] = at;
                pair_splats[at] = i;
            }
            at += 1;
        }
}
