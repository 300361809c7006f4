// How the two numbers of a sample are stored between the passes of a step: as floats in two words, or as halves in one.
// Whatever is summed is a float. engine/src/passes/storage.rs has the other side.
#ifndef SAMPLES_GLSL
#define SAMPLES_GLSL

layout(constant_id = 2) const uint STORAGE = 0;
const uint STORAGE_FULL = 0;
const uint STORAGE_MIXED = 1;

// The nearest half, ties to even; ±65504 where the number lies beyond, so that there is no infinity. NaN stays NaN: the
// optimiser counts it. In integers, because a driver may round packHalf2x16 in another way.
uint half_bits(float v) {
    uint bits = floatBitsToUint(v);
    uint size = bits & 0x7FFFFFFFu;
    uint magnitude;
    if (size > 0x7F800000u) {
        magnitude = 0x7E00u;
    } else if (size >= 0x477FE000u) { // 65504
        magnitude = 0x7BFFu;
    } else if (size >= 0x38800000u) { // 2^-14: the exponent counts from 15 instead of 127
        magnitude = ((size + 0xFFFu + ((size >> 13) & 1u)) >> 13) - (112u << 10);
    } else {                          // steps of 2^-24
        magnitude = uint(roundEven(uintBitsToFloat(size) * 16777216.0));
    }
    return magnitude | ((bits >> 16) & 0x8000u);
}

uint pack_halves(vec2 v) {
    return half_bits(v.x) | (half_bits(v.y) << 16);
}

#endif
