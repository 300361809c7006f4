// What the loss kernels share: one workgroup owns a brick; the loss value and its weight are summed over the
// brick in a fixed order, every 64th sample together and then the 64 sums. A loss never sees a splat.
// Bindings from 6 on are the term's, and so are the constants from 4 on.
//
// The first term overwrites the adjoints (dL/dV^, dL/dW), later ones add to them. The last one folds them
// into what the backward pass multiplies with a splat's intensity c: A = dL/dV^ / (W + ε) and
// H = dL/dW - A V^, so that dL/dw = A c + H and dL/dc = A w.
#include "samples.glsl"
layout(local_size_x_id = 3) in;
layout(push_constant, scalar) uniform LossParams {
    float weight;      // λ of this term
    float parameter;   // what the term needs besides: see there
    float epsilon;     // of equation (2)
    float region;      // a sample is of the region where M is above this; below 0: the term has M itself
    float low;         // the lower end of the intensity range, relative to the background
    float tolerance;   // an error of the occupancy up to this costs nothing
} p;
layout(constant_id = 0) const uint ACCUMULATE = 0; // 1: not the first term
layout(constant_id = 1) const uint FOLD = 0;       // 1: the last term
layout(constant_id = 3) const uint GROUP = 64;     // invocations of a workgroup: 64, or 8 for CPU drivers
layout(scalar, binding = 2) buffer Adjoints { uint adjoints[]; };
layout(scalar, binding = 3) writeonly buffer LossSums { vec2 loss_sums[]; }; // [slot]: Σ value, Σ weight
layout(scalar, binding = 4) readonly buffer Starts { uint starts[]; };       // [slot]: its first pair
layout(scalar, binding = 5) readonly buffer UntouchedSums { vec2 untouched_sums[]; }; // [slot] that no pair reaches

shared vec2 partial[64];

Adjoint load_adjoint(uint i) {
    if (STORAGE == STORAGE_MIXED) {
        vec2 halves = unpackHalf2x16(adjoints[i]);
        return Adjoint(halves.x, halves.y);
    }
    return Adjoint(uintBitsToFloat(adjoints[2 * i]), uintBitsToFloat(adjoints[2 * i + 1]));
}

void store_adjoint(uint i, Adjoint adjoint) {
    if (STORAGE == STORAGE_MIXED) {
        adjoints[i] = pack_halves(vec2(adjoint.value, adjoint.weight));
    } else {
        adjoints[2 * i] = floatBitsToUint(adjoint.value);
        adjoints[2 * i + 1] = floatBitsToUint(adjoint.weight);
    }
}

// Adds the term's value, weight and adjoint at one sample that takes part.
void loss_term(Target wanted, Reconstruction got, out vec2 value_weight, out Adjoint adjoint);

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint slot = gl_WorkGroupID.x;
    uint begin = slot * 512;
    if (starts[slot] == starts[slot + 1]) {
        // A mini-batch leaves most bricks so. The sums are known, and there is nothing to move: a splat whose
        // support holds only samples that take no part has no pair, and reads zeros.
        if (lane == 0) loss_sums[slot] = untouched_sums[slot];
        if (ACCUMULATE == 0)
            for (uint i = begin + lane; i < begin + 512; i += GROUP) store_adjoint(i, Adjoint(0.0, 0.0));
        return;
    }
    for (uint t = lane; t < 64; t += GROUP) {
        vec2 sum = vec2(0.0);
        for (uint i = begin + t; i < begin + 512; i += 64) {
            Target wanted = target_at(i);
            Reconstruction got = reconstruction_at(i);
            Adjoint adjoint = Adjoint(0.0, 0.0);
            if (wanted.occupancy >= 0.0) {
                vec2 value_weight;
                loss_term(wanted, got, value_weight, adjoint);
                sum += value_weight;
            }
            if (ACCUMULATE != 0) {
                Adjoint before = load_adjoint(i);
                adjoint.value += before.value;
                adjoint.weight += before.weight;
            }
            if (FOLD != 0) {
                adjoint.value /= got.weight + p.epsilon;
                adjoint.weight -= adjoint.value * got.value;
            }
            store_adjoint(i, adjoint);
        }
        partial[t] = sum;
    }
    SUM_OF_64(partial, lane, GROUP)
    if (lane == 0) loss_sums[slot] = partial[0];
}
