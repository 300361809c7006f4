// How the two numbers of a sample are stored between the passes of a step: as floats in two words, or as
// halves in one. Whatever is summed is a float. engine/passes/src/storage.rs has the other side.
#ifndef STORAGE_GLSL
#define STORAGE_GLSL

#ifndef STORAGE_CONSTANT // a kernel with other constants than most says which comes next
#define STORAGE_CONSTANT 2
#endif
layout(constant_id = STORAGE_CONSTANT) const uint STORAGE = 0;
const uint STORAGE_FULL = 0;
const uint STORAGE_MIXED = 1;

// The nearest half, ties to even; ±65504 where the number lies beyond, so that there is no infinity. NaN
// stays NaN: the optimiser counts it. In integers, because a driver may round packHalf2x16 in another way.
uint half_bits(float v) {
    uint bits = floatBitsToUint(v);
    uint size = bits & 0x7FFFFFFFu;
    uint kept = min(size, 0x477FE000u); // 65504
    // From 2^-14 on ten digits stay, and the exponent counts from 15 instead of 127; below, steps of 2^-24.
    uint many = ((kept + 0xFFFu + ((kept >> 13) & 1u)) >> 13) - (112u << 10);
    uint few = uint(int(roundEven(uintBitsToFloat(kept) * 16777216.0)));
    uint magnitude = mix(few, many, kept >= 0x38800000u);
    magnitude = mix(magnitude, 0x7E00u, size > 0x7F800000u); // NaN
    return magnitude | ((bits >> 16) & 0x8000u);
}

uint pack_halves(vec2 v) {
    return half_bits(v.x) | (half_bits(v.y) << 16);
}

#endif
