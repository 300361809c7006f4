#version 460
// dL/dC of each pixel: the windows that hold a pixel pass on what picture_ssim.comp found for them. One workgroup owns a
// tile, one invocation RUN pixels of a column.
#extension GL_EXT_scalar_block_layout : require
#include "picture_loss.glsl"
layout(local_size_x = 16, local_size_y = 4) in; // LOSS_TILE, RUNS
layout(push_constant, scalar) uniform PictureLossParams { uvec2 size; vec3 background; float ssim_weight; } p;
layout(scalar, binding = 0) readonly buffer Picture { vec4 picture[]; };
layout(scalar, binding = 1) readonly buffer Wanted { uint wanted[]; };
layout(scalar, binding = 2) readonly buffer Slopes { vec3 slopes[]; };
layout(scalar, binding = 3) writeonly buffer PictureGradient { vec3 picture_gradient[]; };

shared float patch_of[3 * LOSS_PATCH * LOSS_PATCH];
shared float rows[3 * LOSS_PATCH * LOSS_TILE]; // filtered along x

void main() {
    ivec2 corner = ivec2(gl_WorkGroupID.xy * LOSS_TILE);
    uvec2 local = uvec2(gl_LocalInvocationID.x, gl_LocalInvocationID.y * RUN);
    uint lane = gl_LocalInvocationIndex;
    vec3 colours[RUN], wants[RUN], gradients[RUN];
    for (uint r = 0; r < RUN; ++r) {
        uvec2 pixel = uvec2(corner) + local + uvec2(0, r);
        colours[r] = vec3(0.0);
        wants[r] = vec3(0.0);
        if (any(greaterThanEqual(pixel, p.size))) continue;
        uint at = pixel.y * p.size.x + pixel.x;
        vec4 stored = unpackUnorm4x8(wanted[at]);
        wants[r] = stored.rgb + (1.0 - stored.a) * p.background;
        colours[r] = picture[at].rgb;
    }
    for (uint channel = 0; channel < 3; ++channel) {
        barrier();
        for (uint i = lane; i < LOSS_PATCH * LOSS_PATCH; i += LOSS_TILE * RUNS) {
            ivec2 at = corner + ivec2(i % LOSS_PATCH, i / LOSS_PATCH) - int(WINDOW_REACH);
            bool there = all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, ivec2(p.size)));
            vec3 slope = there ? slopes[(uint(at.y) * p.size.x + uint(at.x)) * 3 + channel] : vec3(0.0);
            for (uint j = 0; j < 3; ++j) patch_of[3 * i + j] = slope[j];
        }
        barrier();
        for (uint i = lane; i < 3 * LOSS_PATCH * RUNS; i += LOSS_TILE * RUNS) {
            uint row = i / (3 * RUNS), x = i / 3 % RUNS * RUN, of = i % 3;
            float slope[RUN_READS];
            for (uint k = 0; k < RUN_READS; ++k) slope[k] = patch_of[3 * (row * LOSS_PATCH + x + k) + of];
            for (uint r = 0; r < RUN; ++r) {
                float sum = 0.0;
                for (uint k = 0; k <= 2 * WINDOW_REACH; ++k) sum += WINDOW[k] * slope[r + k];
                rows[3 * (row * LOSS_TILE + x + r) + of] = sum;
            }
        }
        barrier();
        vec3 slope[RUN_READS];
        for (uint k = 0; k < RUN_READS; ++k) {
            uint from = 3 * ((local.y + k) * LOSS_TILE + local.x);
            slope[k] = vec3(rows[from], rows[from + 1], rows[from + 2]);
        }
        for (uint r = 0; r < RUN; ++r) {
            vec3 sum = vec3(0.0);
            for (uint k = 0; k <= 2 * WINDOW_REACH; ++k) sum += WINDOW[k] * slope[r + k];
            float c = colours[r][channel], want = wants[r][channel];
            gradients[r][channel] = -p.ssim_weight * (sum.x + 2.0 * c * sum.y + want * sum.z)
                + (1.0 - p.ssim_weight) * sign(c - want);
        }
    }
    for (uint r = 0; r < RUN; ++r) {
        uvec2 pixel = uvec2(corner) + local + uvec2(0, r);
        if (any(greaterThanEqual(pixel, p.size))) continue;
        picture_gradient[pixel.y * p.size.x + pixel.x] = gradients[r] / float(3 * p.size.x * p.size.y);
    }
}
