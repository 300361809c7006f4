#version 460
// Lists the splats that are active, in their order: `places` is the prefix sum of their flags, and the total.
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform ListParams { uint count; } p;
layout(scalar, binding = 0) readonly buffer Places { uint places[]; };
layout(scalar, binding = 1) writeonly buffer Active { uint active_splats[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.count) return;
    uint at = places[i];
    if (places[i + 1] > at) active_splats[at] = i;
}
