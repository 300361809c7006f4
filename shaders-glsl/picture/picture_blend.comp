#version 460
// Blends the splats of a tile from front to back, before a background. One workgroup owns a tile.
//
// With GROUP = 64 an invocation owns a pixel, as GPUs want it; with GROUP = 8 a column of pixels, which CPU drivers want:
// a splat is then read once for all of them. The bits are the same.
// engine/passes/src/workgroup_shape.rs has the choice.
#include "picture.glsl"
layout(local_size_x_id = 0) in;
layout(constant_id = 0) const uint GROUP = 64;
layout(push_constant, scalar) uniform PictureBlendParams { uvec2 size; vec3 background; } p;
layout(scalar, binding = 0) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 1) readonly buffer Pairs { uint pairs[]; };
layout(scalar, binding = 2) readonly buffer PairSplats { uint pair_splats[]; };
layout(scalar, binding = 3) readonly buffer PictureSplats { PictureSplat picture_splats[]; };
layout(scalar, binding = 4) writeonly buffer Picture { vec4 picture[]; }; // colour over the background, what passes
layout(scalar, binding = 5) writeonly buffer Ends { uint ends[]; };       // behind the last pair that a pixel shows

const uint ROWS = TILE_PIXELS / GROUP; // of an invocation
shared PictureSplat batch[GROUP];
shared uint open_pixels;

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint tile = gl_WorkGroupID.x;
    uint columns = (p.size.x + PICTURE_TILE - 1) / PICTURE_TILE;
    uvec2 pixel = uvec2(tile % columns, tile / columns) * PICTURE_TILE + uvec2(lane % PICTURE_TILE, lane / PICTURE_TILE);
    vec2 place = vec2(pixel) + 0.5;
    uint first = starts[tile], end = starts[tile + 1];
    vec3 colours[ROWS];
    float passed[ROWS]; // 0 where nothing more is shown
    float passes[ROWS]; // the same, but there it stays
    uint shown[ROWS];
    for (uint row = 0; row < ROWS; ++row) {
        bool inside = pixel.x < p.size.x && pixel.y + row < p.size.y;
        colours[row] = vec3(0.0);
        passed[row] = inside ? 1.0 : 0.0;
        passes[row] = 1.0;
        shown[row] = first;
    }
    for (uint base = first; base < end; base += GROUP) {
        barrier();
        if (lane == 0) open_pixels = 0;
        if (base + lane < end) batch[lane] = picture_splats[pair_splats[pairs[base + lane]]];
        barrier();
        float most = 0.0;
        for (uint row = 0; row < ROWS; ++row) most = max(most, passed[row]);
        if (most > 0.0) atomicOr(open_pixels, 1);
        barrier();
        if (open_pixels == 0) break;
        uint count = min(GROUP, end - base);
        for (uint k = 0; k < count; ++k) {
            PictureSplat s = batch[k];
            for (uint row = 0; row < ROWS; ++row) {
                float opacity = min(picture_opacity(s, place + vec2(0.0, row) - s.centre), MOST_OPACITY);
                // No branches: they would cost CPU drivers more than what they save.
                bool is_shown = opacity >= LEAST_OPACITY && passed[row] > 0.0;
                opacity = is_shown ? opacity : 0.0;
                colours[row] += opacity * passed[row] * s.colour;
                shown[row] = is_shown ? base + k + 1 : shown[row];
                passes[row] *= 1.0 - opacity;
                passed[row] = passes[row] >= LEAST_PASSED ? passed[row] * (1.0 - opacity) : 0.0;
            }
        }
    }
    for (uint row = 0; row < ROWS; ++row) {
        if (pixel.x >= p.size.x || pixel.y + row >= p.size.y) break;
        uint at = (pixel.y + row) * p.size.x + pixel.x;
        picture[at] = vec4(colours[row] + passes[row] * p.background, passes[row]);
        ends[at] = shown[row];
    }
}
