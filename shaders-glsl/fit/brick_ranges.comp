#version 460
// Finds where the pairs of each slot begin: starts[s] is the first sorted pair whose key is >= s, starts[slots]
// the count. One invocation owns a pair and fills the starts from the key before it (exclusive) to its own.
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 256) in;
layout(push_constant, scalar) uniform RangeParams { uint slot_count; uint count_index; uint capacity; } p;
layout(scalar, binding = 0) readonly buffer PairOffsets { uint pair_offsets[]; };
layout(scalar, binding = 1) readonly buffer Keys { uint keys[]; };
layout(scalar, binding = 2) writeonly buffer Starts { uint starts[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    uint count = min(pair_offsets[p.count_index], p.capacity);
    if (i > count) return; // i == count closes the table
    uint from = i == 0 ? 0 : keys[i - 1] + 1;
    uint to = i == count ? p.slot_count : keys[i];
    for (uint s = from; s <= to; ++s) starts[s] = i;
}
