// Visibility masks of the views: what of each picture no eye sees, in 64 x 64 patches, two words a row of
// patches, rows from the top, the lowest bit at the left. A kernel says in VISIBILITY_BINDING where the
// patches are bound.
#ifndef VISIBILITY_GLSL
#define VISIBILITY_GLSL
#extension GL_EXT_scalar_block_layout : require

const uint PATCHES = 64u;

layout(scalar, binding = VISIBILITY_BINDING) readonly buffer Patches { uint patches[]; };

// The bits of a row of patches that come before one.
uvec2 patches_before(uint end) {
    uint low = end < 32u ? (1u << end) - 1u : ~0u;
    uint high = end <= 32u ? 0u : end < 64u ? (1u << (end - 32u)) - 1u : ~0u;
    return uvec2(low, high);
}

// Whether all patches of a rectangle are hidden; `last` is the last one within, both at most 63.
bool all_hidden(uint view, uvec2 first, uvec2 last) {
    uvec2 span = patches_before(last.x + 1u) & ~patches_before(first.x);
    for (uint y = first.y; y <= last.y; ++y) {
        uint at = (view * PATCHES + y) * 2u;
        if ((~patches[at] & span.x | ~patches[at + 1u] & span.y) != 0u) return false;
    }
    return true;
}

#endif
