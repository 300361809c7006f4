#version 460
// Of the splats that are flagged, only the most important stay flagged, as many as the budget allows:
// `places` is the prefix sum of the flags in the order of importance, `ranks` has the place of a splat in
// that order. One invocation owns a splat.
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform LimitParams { uint count; uint budget; } p;
layout(scalar, binding = 0) readonly buffer Places { uint places[]; };
layout(scalar, binding = 1) readonly buffer Ranks { uint ranks[]; };
layout(scalar, binding = 2) buffer Flags { uint flags[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.count) return;
    if (places[ranks[i]] >= p.budget) flags[i] = 0;
}
