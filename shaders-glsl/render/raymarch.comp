#version 460
// Marches the rays of all pixels (march.glsl).
//
// One invocation owns a pixel. Eight make a block of 4 x 2 pixels; a workgroup is one block where subgroups
// are of eight (CPU drivers), else a square of eight blocks.
#extension GL_EXT_shader_image_load_formatted : require
#include "march.glsl"
layout(local_size_x_id = 12) in;
layout(constant_id = 11) const uint DEPTH = 0; // 1: depth is written
layout(constant_id = 12) const uint GROUP = 64;
layout(binding = 13) writeonly uniform image2DArray colour_image;
layout(binding = 14) writeonly uniform image2DArray depth_image;

void main() {
    uint lane = gl_LocalInvocationIndex & 7u, block = gl_LocalInvocationIndex >> 3;
    uvec2 pixel = uvec2(lane & 3u, lane >> 2) + uvec2(block & 1u, block >> 1) * uvec2(4, 2);
    if (GROUP == 8) pixel += gl_WorkGroupID.xy * uvec2(4, 2);
    else pixel += gl_WorkGroupID.xy * 8;
    bool inside = all(lessThan(pixel, p.size));
    Gathered gathered = march(vec2(pixel) + 0.5, gl_WorkGroupID.z, inside);
    if (!inside) return;
    ivec3 out_at = ivec3(pixel, gl_WorkGroupID.z);
    imageStore(colour_image, out_at, gathered.colour);
    if (DEPTH == 1) imageStore(depth_image, out_at, vec4(gathered.depth));
}
