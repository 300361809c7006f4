#version 460
// dL/dC of each pixel: the windows that hold a pixel pass on what picture_ssim.comp found for them. One workgroup owns a
// tile, one invocation a pixel.
#extension GL_EXT_scalar_block_layout : require
#include "picture_loss.glsl"
layout(local_size_x = 16, local_size_y = 16) in;
layout(push_constant, scalar) uniform PictureLossParams { uvec2 size; vec3 background; float ssim_weight; } p;
layout(scalar, binding = 0) readonly buffer Picture { vec4 picture[]; };
layout(scalar, binding = 1) readonly buffer Wanted { uint wanted[]; };
layout(scalar, binding = 2) readonly buffer Slopes { vec3 slopes[]; };
layout(scalar, binding = 3) writeonly buffer PictureGradient { vec3 picture_gradient[]; };

shared float patch_of[3 * LOSS_PATCH * LOSS_PATCH];
shared float rows[3 * LOSS_PATCH * LOSS_TILE];

void main() {
    ivec2 corner = ivec2(gl_WorkGroupID.xy * LOSS_TILE);
    ivec2 local = ivec2(gl_LocalInvocationID.xy);
    ivec2 pixel = corner + local;
    bool inside = all(lessThan(pixel, ivec2(p.size)));
    uint own = uint(pixel.y) * p.size.x + uint(pixel.x);
    uint lane = gl_LocalInvocationIndex;
    vec3 c = vec3(0.0), want = vec3(0.0), gradient = vec3(0.0);
    if (inside) {
        vec4 stored = unpackUnorm4x8(wanted[own]);
        want = stored.rgb + (1.0 - stored.a) * p.background;
        c = picture[own].rgb;
    }
    for (uint channel = 0; channel < 3; ++channel) {
        barrier();
        for (uint i = lane; i < LOSS_PATCH * LOSS_PATCH; i += LOSS_TILE * LOSS_TILE) {
            ivec2 at = corner + ivec2(i % LOSS_PATCH, i / LOSS_PATCH) - int(WINDOW_REACH);
            bool there = all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, ivec2(p.size)));
            vec3 slope = there ? slopes[(uint(at.y) * p.size.x + uint(at.x)) * 3 + channel] : vec3(0.0);
            for (uint j = 0; j < 3; ++j) patch_of[3 * i + j] = slope[j];
        }
        barrier();
        for (uint i = lane; i < 3 * LOSS_PATCH * LOSS_TILE; i += LOSS_TILE * LOSS_TILE) {
            uint place = i / 3;
            uint from = 3 * ((place / LOSS_TILE) * LOSS_PATCH + place % LOSS_TILE) + i % 3;
            float sum = 0.0;
            for (uint k = 0; k <= 2 * WINDOW_REACH; ++k) sum += WINDOW[k] * patch_of[from + 3 * k];
            rows[i] = sum;
        }
        barrier();
        vec3 sum = vec3(0.0);
        for (uint k = 0; k <= 2 * WINDOW_REACH; ++k) {
            uint from = 3 * ((uint(local.y) + k) * LOSS_TILE + uint(local.x));
            sum += WINDOW[k] * vec3(rows[from], rows[from + 1], rows[from + 2]);
        }
        gradient[channel] = -p.ssim_weight * (sum.x + 2.0 * c[channel] * sum.y + want[channel] * sum.z)
            + (1.0 - p.ssim_weight) * sign(c[channel] - want[channel]);
    }
    if (inside) picture_gradient[own] = gradient / float(3 * p.size.x * p.size.y);
}
