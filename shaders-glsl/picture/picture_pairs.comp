#version 460
// Writes a pair for each tile that a splat is drawn in: the key is the tile and, below it, the depth, so that a sort
// puts the splats of a tile from front to back; the value is the pair's own number. One invocation owns a splat and the
// run of pairs that the prefix sum gave it; pairs behind the capacity are dropped (the host sees the total).
#include "picture.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform PicturePairParams {
    uvec2 size;
    uint splat_count;
    uint capacity;
    uint depth_bits;
    float nearest; // depths that become the first and the last step of the key, mm
    float farthest;
} p;
layout(scalar, binding = 0) readonly buffer PictureSplats { PictureSplat picture_splats[]; };
layout(scalar, binding = 1) readonly buffer PairOffsets { uint pair_offsets[]; };
layout(scalar, binding = 2) writeonly buffer Keys { uint keys[]; };
layout(scalar, binding = 3) writeonly buffer Values { uint values[]; };
layout(scalar, binding = 4) writeonly buffer PairSplats { uint pair_splats[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.splat_count) return;
    uint at = pair_offsets[i], end = min(pair_offsets[i + 1], p.capacity);
    if (at >= end) return;
    PictureSplat s = picture_splats[i];
    float part = clamp((s.depth - p.nearest) / (p.farthest - p.nearest), 0.0, 1.0);
    // A float rounds many ones up to the bit above them.
    uint most = (1u << p.depth_bits) - 1, depth = min(uint(part * float(most)), most);
    uint columns = (p.size.x + PICTURE_TILE - 1) / PICTURE_TILE;
    uvec4 box = picture_tiles(s, p.size);
    for (uint y = box.y; y < box.w; ++y)
        for (uint x = box.x; x < box.z; ++x) {
            if (!reaches_tile(s, uvec2(x, y))) continue;
            if (at < end) {
                keys[at] = (y * columns + x) << p.depth_bits | depth;
                values[at] = at;
                pair_splats[at] = i;
            }
            at += 1;
        }
}
