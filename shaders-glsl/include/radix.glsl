// The size of things in a radix sort, the same for its two kernels.
#ifndef RADIX_GLSL
#define RADIX_GLSL

const uint DIGIT_BITS = 6;
const uint DIGITS = 1u << DIGIT_BITS;
// Pairs of a workgroup.
const uint RADIX_BLOCK = 2048;

#endif
