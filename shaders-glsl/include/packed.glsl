// A splat in 16 bytes. engine::splat::packed says which bits are what, and packs.
#ifndef PACKED_GLSL
#define PACKED_GLSL
#include "splat.glsl"

// Splats of a chunk: row i belongs to chunk i / PACKED_CHUNK.
const uint PACKED_CHUNK = 256;

// What the rows of a chunk are measured by.
struct PackedChunk {
    vec3 low; // box of the means
    float log_scale_low;
    vec3 high;
    float log_scale_high;
};

// What all rows of a set are measured by.
struct PackedRange {
    float logit_low;
    float logit_high;
    float intensity_low;
    float intensity_high;
};

// Both ends are weighted, so that they come out exactly and no difference overflows; precise keeps it that
// way.
float packed_between(float low, float high, uint code, float last) {
    float t = float(code) / last;
    precise float value = low * (1.0 - t) + high * t;
    return value;
}

vec4 packed_rotation(uint word) {
    uvec3 code = uvec3(word, word >> 10, word >> 20) & 0x3FFu;
    vec3 v = (vec3(code) - 511.0) * (0.70710678 / 511.0);
    float largest = sqrt(max(1.0 - dot(v, v), 0.0));
    switch (word >> 30) {
        case 0u: return vec4(largest, v);
        case 1u: return vec4(v.x, largest, v.yz);
        case 2u: return vec4(v.xy, largest, v.z);
        default: return vec4(v, largest);
    }
}

// The label of a row; 0 is none.
uint packed_label(uvec4 row) {
    return row.w >> 16 & 0xFFu;
}

// The mean of a row alone, where that is enough.
vec3 packed_mean(uvec4 row, PackedChunk chunk) {
    uvec3 code = uvec3(row.x & 0xFFFu, row.x >> 12 & 0xFFFu, row.x >> 24 | (row.w >> 24 & 0xFu) << 8);
    return vec3(
        packed_between(chunk.low.x, chunk.high.x, code.x, 4095.0),
        packed_between(chunk.low.y, chunk.high.y, code.y, 4095.0),
        packed_between(chunk.low.z, chunk.high.z, code.z, 4095.0));
}

Splat unpack(uvec4 row, PackedChunk chunk, PackedRange range) {
    float low = chunk.log_scale_low, high = chunk.log_scale_high;
    Splat s;
    s.mean = packed_mean(row, chunk);
    s.opacity_logit = packed_between(range.logit_low, range.logit_high, row.z >> 27 | row.w >> 28 << 5, 511.0);
    s.rotation = packed_rotation(row.y);
    s.log_scale = vec3(
        packed_between(low, high, row.z & 0x1FFu, 511.0),
        packed_between(low, high, row.z >> 9 & 0x1FFu, 511.0),
        packed_between(low, high, row.z >> 18 & 0x1FFu, 511.0));
    s.intensity = packed_between(range.intensity_low, range.intensity_high, row.w & 0xFFFFu, 65535.0);
    return s;
}

#endif
