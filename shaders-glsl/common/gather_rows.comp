#version 460
// out[i] = rows[indices[first + i]] for rows of any number of words; one word an invocation.
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 256) in;
layout(push_constant, scalar) uniform RowParams { uint count; uint words; uint first; } p;
layout(scalar, binding = 0) readonly buffer Rows { uint rows[]; };
layout(scalar, binding = 1) readonly buffer Indices { uint indices[]; };
layout(scalar, binding = 2) writeonly buffer Gathered { uint gathered[]; };

void main() {
    uint word = gl_GlobalInvocationID.x;
    uint i = word / p.words;
    if (i >= p.count) return;
    gathered[word] = rows[indices[p.first + i] * p.words + (word - i * p.words)];
}
