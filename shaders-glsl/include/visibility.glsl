// Visibility masks of the views: what of each picture no eye sees, in 64 x 64 patches, two words a row of
// patches, rows from the top, the lowest bit at the left. A kernel says in VISIBILITY_BINDING where the
// patches are bound.
#ifndef VISIBILITY_GLSL
#define VISIBILITY_GLSL
#extension GL_EXT_scalar_block_layout : require

const uint PATCHES = 64;

layout(scalar, binding = VISIBILITY_BINDING) readonly buffer Patches { uint patches[]; };

// The bits of a row of patches that come before one.
uvec2 patches_before(uint end) {
    uint low = end < 32 ? (1u << end) - 1 : ~0u;
    uint high = end <= 32 ? 0u : end < 64 ? (1u << (end - 32)) - 1 : ~0u;
    return uvec2(low, high);
}

// Whether all patches of a rectangle are hidden; `last` is the last one within, both at most 63.
bool all_hidden(uint view, uvec2 first, uvec2 last) {
    uvec2 span = patches_before(last.x + 1) & ~patches_before(first.x);
    for (uint y = first.y; y <= last.y; ++y) {
        uint at = (view * PATCHES + y) * 2;
        if ((~patches[at] & span.x | ~patches[at + 1] & span.y) != 0) return false;
    }
    return true;
}

#endif
