// Splats of a scene as they are stored: 48 bytes each in full, 16 when packed.
#ifndef ROWS_GLSL
#define ROWS_GLSL
#include "packed.glsl"

// A full row.
Splat full_splat(uvec4 a, uvec4 b, uvec4 c) {
    vec4 first = uintBitsToFloat(a), last = uintBitsToFloat(c);
    return Splat(first.xyz, first.w, uintBitsToFloat(b), last.xyz, last.w);
}

#endif
