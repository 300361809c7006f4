#version 460
// Which of the eight parts of each tile no eye sees: those of which every pixel, and every one beside it,
// which samplers mix in, lies in hidden patches. A part beyond the picture is hidden. One invocation owns a
// tile of a view.
#define VISIBILITY_BINDING 0
#include "visibility.glsl"
#include "tiles.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform HiddenParams { uvec2 size; uvec2 tiles; } p;
layout(scalar, binding = 1) writeonly buffer HiddenParts { uint hidden_parts[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint count = p.tiles.x * p.tiles.y;
    if (i >= count) return;
    uvec2 tile = uvec2(i % p.tiles.x, i / p.tiles.x);
    uint hidden = 0;
    for (uint part = 0; part < PARTS; ++part) {
        uvec2 from = tile * TILE + uvec2((part & 3u) * 4, (part >> 2) * 8);
        uvec2 to = min(from + uvec2(5, 9), p.size);
        bool beyond = any(greaterThanEqual(from, p.size));
        from = max(from, uvec2(1)) - 1;
        // Pixel x covers [x, x + 1) / size of the picture, patch k [k, k + 1) / PATCHES.
        if (beyond || all_hidden(gl_WorkGroupID.y, from * PATCHES / p.size, (to * PATCHES - 1) / p.size)) {
            hidden |= 1u << part;
        }
    }
    hidden_parts[gl_WorkGroupID.y * count + i] = hidden;
}
