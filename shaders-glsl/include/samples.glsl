// Targets and reconstructions as the kernels of the losses bind and read them, and the predicted mask.
#ifndef SAMPLES_GLSL
#define SAMPLES_GLSL
#include "splat.glsl"
#include "storage.glsl"
layout(scalar, binding = 0) readonly buffer Targets { uint targets[]; };
layout(scalar, binding = 1) readonly buffer Reconstructions { uint reconstructions[]; };

Target target_at(uint sample_index) {
    return unpack_target(targets[sample_index]);
}

Reconstruction reconstruction_at(uint sample_index) {
    if (STORAGE == STORAGE_MIXED) {
        vec2 halves = unpackHalf2x16(reconstructions[sample_index]);
        return Reconstruction(halves.x, halves.y);
    }
    uint first = 2 * sample_index;
    return Reconstruction(uintBitsToFloat(reconstructions[first]), uintBitsToFloat(reconstructions[first + 1]));
}

// m^ = 1 - exp(-W), the predicted mask. Below 1/64 by its series to the third order, which leaves out 2e-7 of
// the value, where the difference loses more the smaller W is. What is no weight (NaN) predicts nothing: the
// sums over all samples use this, and one bad splat must not spoil them for all others.
float predicted_mask(float weight) {
    if (!(weight > 0.0)) return 0.0;
    if (weight < 1.0 / 64.0) return weight * (1.0 - weight * (0.5 - weight * (1.0 / 6.0)));
    return 1.0 - exp(-weight);
}

#ifdef QUANTITY_CONSTANT
// What a kernel compares, predicted with wanted: m^ with M, or V^ with V, both from the lower end of their
// range on.
layout(constant_id = QUANTITY_CONSTANT) const uint QUANTITY = 0;
const uint QUANTITY_MASK = 0;
const uint QUANTITY_INTENSITY = 1;

// (predicted, wanted), in 0..1. `low` is what the lower end of the range is relative to the background.
vec2 compared(Target wanted, Reconstruction got, float low) {
    if (QUANTITY == QUANTITY_INTENSITY) return vec2(got.value, wanted.value) - low;
    return vec2(predicted_mask(got.weight), wanted.occupancy);
}
#endif

// The sum of `partial` (64 rows that a workgroup shares), the same additions in the same order whatever its
// size: a tree. A workgroup of 8 is for CPU drivers, where a barrier costs more than what one invocation adds
// alone.
#define SUM_OF_64(partial, lane, group)                                                            \
    if (group == 8) {                                                                              \
        barrier();                                                                                 \
        if (lane == 0)                                                                             \
            for (uint half_size = 32; half_size > 0; half_size >>= 1)                              \
                for (uint i = 0; i < half_size; ++i) partial[i] += partial[i + half_size];         \
    } else {                                                                                       \
        for (uint half_size = 32; half_size > 0; half_size >>= 1) {                                \
            barrier();                                                                             \
            if (lane < half_size) partial[lane] += partial[lane + half_size];                      \
        }                                                                                          \
    }

#endif
