#version 460
// The loss of a tile, and the derivatives of the SSIM around each pixel by the means in its window: of C, C² and C C*.
// One workgroup owns a tile, one invocation RUN pixels of a column; channel by channel, along x and then along y.
#extension GL_EXT_scalar_block_layout : require
#include "picture_loss.glsl"
layout(local_size_x = 16, local_size_y = 4) in; // LOSS_TILE, RUNS
layout(push_constant, scalar) uniform PictureLossParams { uvec2 size; vec3 background; float ssim_weight; } p;
layout(scalar, binding = 0) readonly buffer Picture { vec4 picture[]; };
layout(scalar, binding = 1) readonly buffer Wanted { uint wanted[]; }; // colour times opacity and opacity, 8 bits each
layout(scalar, binding = 2) writeonly buffer Slopes { vec3 slopes[]; }; // [pixel][channel], by mean C, C², C C*
layout(scalar, binding = 3) writeonly buffer Losses { vec2 losses[]; }; // of each tile: Σ |C - C*|, Σ SSIM

shared vec2 patch_of[LOSS_PATCH * LOSS_PATCH];
shared vec2 means[LOSS_PATCH * LOSS_TILE];   // [row][x], filtered along x: C, C*
shared float squares[3 * LOSS_PATCH * LOSS_TILE]; // C², C*², C C*

void main() {
    ivec2 corner = ivec2(gl_WorkGroupID.xy * LOSS_TILE);
    uvec2 local = uvec2(gl_LocalInvocationID.x, gl_LocalInvocationID.y * RUN);
    uint lane = gl_LocalInvocationIndex;
    vec2 loss = vec2(0.0);
    for (uint channel = 0; channel < 3; ++channel) {
        barrier();
        for (uint i = lane; i < LOSS_PATCH * LOSS_PATCH; i += LOSS_TILE * RUNS) {
            ivec2 at = corner + ivec2(i % LOSS_PATCH, i / LOSS_PATCH) - int(WINDOW_REACH);
            vec2 pair = vec2(0.0);
            if (all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, ivec2(p.size)))) {
                uint from = uint(at.y) * p.size.x + uint(at.x);
                vec4 want = unpackUnorm4x8(wanted[from]);
                pair = vec2(picture[from][channel], want[channel] + (1.0 - want.a) * p.background[channel]);
            }
            patch_of[i] = pair;
        }
        barrier();
        for (uint i = lane; i < LOSS_PATCH * RUNS; i += LOSS_TILE * RUNS) {
            uint row = i / RUNS, x = i % RUNS * RUN;
            vec2 c[RUN_READS];
            for (uint k = 0; k < RUN_READS; ++k) c[k] = patch_of[row * LOSS_PATCH + x + k];
            for (uint r = 0; r < RUN; ++r) {
                vec2 mean = vec2(0.0);
                vec3 square = vec3(0.0);
                for (uint k = 0; k <= 2 * WINDOW_REACH; ++k) {
                    mean += WINDOW[k] * c[r + k];
                    square += WINDOW[k] * vec3(c[r + k] * c[r + k], c[r + k].x * c[r + k].y);
                }
                uint to = row * LOSS_TILE + x + r;
                means[to] = mean;
                for (uint j = 0; j < 3; ++j) squares[3 * to + j] = square[j];
            }
        }
        barrier();
        vec2 m[RUN_READS];
        vec3 e[RUN_READS];
        for (uint k = 0; k < RUN_READS; ++k) {
            uint from = (local.y + k) * LOSS_TILE + local.x;
            m[k] = means[from];
            e[k] = vec3(squares[3 * from], squares[3 * from + 1], squares[3 * from + 2]);
        }
        for (uint r = 0; r < RUN; ++r) {
            vec2 mean = vec2(0.0);
            vec3 square = vec3(0.0);
            for (uint k = 0; k <= 2 * WINDOW_REACH; ++k) {
                mean += WINDOW[k] * m[r + k];
                square += WINDOW[k] * e[r + k];
            }
            uvec2 pixel = uvec2(corner) + local + uvec2(0, r);
            if (any(greaterThanEqual(pixel, p.size))) continue;
            float a = 2.0 * mean.x * mean.y + SSIM_C1, b = 2.0 * (square.z - mean.x * mean.y) + SSIM_C2;
            float c = mean.x * mean.x + mean.y * mean.y + SSIM_C1;
            float d = square.x + square.y - mean.x * mean.x - mean.y * mean.y + SSIM_C2;
            float ssim = a * b / (c * d);
            vec2 own = patch_of[(local.y + r + WINDOW_REACH) * LOSS_PATCH + local.x + WINDOW_REACH];
            loss += vec2(abs(own.x - own.y), ssim);
            vec3 slope;
            slope.x = 2.0 * mean.y * (b - a) / (c * d) + 2.0 * mean.x * ssim * (1.0 / d - 1.0 / c);
            slope.y = -ssim / d;
            slope.z = 2.0 * a / (c * d);
            slopes[(pixel.y * p.size.x + pixel.x) * 3 + channel] = slope;
        }
    }
    // The sums take the place of the means.
    barrier();
    means[lane] = loss;
    for (uint half_count = LOSS_TILE * RUNS / 2; half_count > 0; half_count /= 2) {
        barrier();
        if (lane < half_count) means[lane] += means[lane + half_count];
    }
    if (lane == 0) losses[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x] = means[0];
}
