#version 460
// Lists the splats that are active, in their order, and the objects that they belong to: `places` is the
// prefix sum of their flags, and the total.
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform ListParams { uint count; } p;
layout(scalar, binding = 0) readonly buffer Places { uint places[]; };
layout(scalar, binding = 1) readonly buffer Objects { uint objects[]; };
layout(scalar, binding = 2) writeonly buffer Active { uint active_splats[]; };
layout(scalar, binding = 3) writeonly buffer ActiveObjects { uint active_objects[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.count) return;
    uint at = places[i];
    if (places[i + 1] == at) return;
    active_splats[at] = i;
    active_objects[at] = objects[i];
}
