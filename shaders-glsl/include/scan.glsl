// The size of things in a prefix sum, the same for its kernels.
#ifndef SCAN_GLSL
#define SCAN_GLSL

// Elements of a workgroup.
const uint SCAN_BLOCK = 4096;
// Neighbouring elements of an invocation.
const uint SCAN_RUN = SCAN_BLOCK / 256;

#endif
