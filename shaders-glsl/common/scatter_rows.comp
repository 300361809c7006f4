#version 460
// rows[indices[first + i]] = gathered[i]: puts back what gather_rows took. The indices must differ.
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 256) in;
layout(push_constant, scalar) uniform RowParams { uint count; uint words; uint first; } p;
layout(scalar, binding = 0) readonly buffer Gathered { uint gathered[]; };
layout(scalar, binding = 1) readonly buffer Indices { uint indices[]; };
layout(scalar, binding = 2) writeonly buffer Rows { uint rows[]; };

void main() {
    uint word = gl_GlobalInvocationID.x;
    uint i = word / p.words;
    if (i >= p.count) return;
    rows[indices[p.first + i] * p.words + (word - i * p.words)] = gathered[word];
}
