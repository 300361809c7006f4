#version 460
// One packed splat an invocation, in the order of the rows: from 16 bytes to the 48 of a Splat, and its label.
#include "packed.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform UnpackParams { PackedRange range; uint splat_count; } p;
layout(scalar, binding = 0) readonly buffer Rows { uvec4 rows[]; };
layout(scalar, binding = 1) readonly buffer Chunks { PackedChunk chunks[]; };
layout(scalar, binding = 2) writeonly buffer Splats { Splat splats[]; };
layout(scalar, binding = 3) writeonly buffer Labels { uint labels[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.splat_count) return;
    labels[i] = packed_label(rows[i]);
    splats[i] = unpack(rows[i], chunks[i / PACKED_CHUNK], p.range);
}
