#version 460
// What the Dice loss needs of all samples before it can begin: Σ m^ M, Σ m^ and Σ M of each brick, m^ = 1 - exp(-W). One
// workgroup owns a brick, one invocation every 64th sample; summed in a fixed order.
#define STORAGE_CONSTANT 0
#include "samples.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform OverlapParams { uint first_slot; } p; // of the chunk
layout(scalar, binding = 2) writeonly buffer Partials { vec3 partials[]; }; // [slot], all chunks

shared vec3 partial[64];

void main() {
    uint t = gl_LocalInvocationIndex;
    uint begin = gl_WorkGroupID.x * 512 + t;
    vec3 sum = vec3(0.0);
    for (uint i = begin; i < begin + 512; i += 64) {
        Target wanted = target_at(i);
        if (wanted.occupancy < 0.0) continue;
        float predicted = predicted_mask(reconstruction_at(i).weight);
        sum += vec3(predicted * wanted.occupancy, predicted, wanted.occupancy);
    }
    partial[t] = sum;
    for (uint half_size = 32; half_size > 0; half_size >>= 1) {
        barrier();
        if (t < half_size) partial[t] += partial[t + half_size];
    }
    if (t == 0) partials[p.first_slot + gl_WorkGroupID.x] = partial[0];
}
