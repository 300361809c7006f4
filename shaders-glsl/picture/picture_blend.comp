#version 460
// Blends the splats of a tile from front to back, before a background. One workgroup owns a tile, one invocation a
// pixel.
#include "picture.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform PictureBlendParams { uvec2 size; vec3 background; } p;
layout(scalar, binding = 0) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 1) readonly buffer Pairs { uint pairs[]; };
layout(scalar, binding = 2) readonly buffer PairSplats { uint pair_splats[]; };
layout(scalar, binding = 3) readonly buffer PictureSplats { PictureSplat picture_splats[]; };
layout(scalar, binding = 4) writeonly buffer Picture { vec4 picture[]; }; // colour over the background, what passes
layout(scalar, binding = 5) writeonly buffer Ends { uint ends[]; };       // behind the last pair that a pixel shows

shared PictureSplat batch[TILE_PIXELS];
shared uint open_pixels;

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint tile = gl_WorkGroupID.x;
    uint columns = (p.size.x + PICTURE_TILE - 1) / PICTURE_TILE;
    uvec2 pixel = uvec2(tile % columns, tile / columns) * PICTURE_TILE + uvec2(lane % PICTURE_TILE, lane / PICTURE_TILE);
    vec2 place = vec2(pixel) + 0.5;
    bool inside = all(lessThan(pixel, p.size));
    bool open = inside;
    uint first = starts[tile], end = starts[tile + 1], shown = first;
    vec3 colour = vec3(0.0);
    float passed = 1.0;
    for (uint base = first; base < end; base += TILE_PIXELS) {
        barrier();
        if (lane == 0) open_pixels = 0;
        if (base + lane < end) batch[lane] = picture_splats[pair_splats[pairs[base + lane]]];
        barrier();
        if (open) atomicOr(open_pixels, 1);
        barrier();
        if (open_pixels == 0) break;
        uint count = min(TILE_PIXELS, end - base);
        for (uint k = 0; k < count && open; ++k) {
            PictureSplat s = batch[k];
            float opacity = min(picture_opacity(s, place - s.centre), MOST_OPACITY);
            if (opacity < LEAST_OPACITY) continue;
            colour += opacity * passed * s.colour;
            passed *= 1.0 - opacity;
            shown = base + k + 1;
            open = passed >= LEAST_PASSED;
        }
    }
    if (!inside) return;
    uint at = pixel.y * p.size.x + pixel.x;
    picture[at] = vec4(colour + passed * p.background, passed);
    ends[at] = shown;
}
