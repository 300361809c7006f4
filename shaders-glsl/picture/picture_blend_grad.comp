#version 460
// The derivative of the blended picture: for each pair of a tile and a splat, sums over the pixels of the tile. One
// workgroup owns a tile, and takes its pairs in groups, which it walks from front to back; then the invocations add up in
// a fixed order what each found, so that no float is added atomically. With GROUP = 64 an invocation owns a pixel, and
// four a pair add up what the pixels left; with GROUP = 8 (picture_blend.comp says why) it owns a column of pixels.
//
// With G the derivative of the loss by a pixel's colour C, T what passes in front of a splat and w = α T:
//   dL/dα = T c · G - (C · G - Σ w c · G up to here) / (1 - α),   q = α dL/dα (0 where α is cut),
// and the sums are w G (3), q, q d (2), q d d^T (xx, xy, yy), d from the splat's centre to the pixel.
#include "picture.glsl"
layout(local_size_x_id = 0) in;
layout(constant_id = 0) const uint GROUP = 64;
layout(push_constant, scalar) uniform PictureBlendGradParams { uvec2 size; } p;
layout(scalar, binding = 0) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 1) readonly buffer Pairs { uint pairs[]; };
layout(scalar, binding = 2) readonly buffer PairSplats { uint pair_splats[]; };
layout(scalar, binding = 3) readonly buffer PictureSplats { PictureSplat picture_splats[]; };
layout(scalar, binding = 4) readonly buffer Picture { vec4 picture[]; };
layout(scalar, binding = 5) readonly buffer Ends { uint ends[]; };
layout(scalar, binding = 6) readonly buffer PictureGradient { vec3 picture_gradient[]; };
layout(scalar, binding = 7) writeonly buffer PictureMoments { float moments[]; }; // [pair][PICTURE_MOMENTS]

const uint ROWS = TILE_PIXELS / GROUP; // of an invocation
const uint PARTS = 8 - GROUP / 16;     // of which the sum of a pair is added up
const uint TAKEN = TILE_PIXELS / PARTS; // pairs at once
shared PictureSplat taken[TAKEN];
shared vec2 left[TAKEN * TILE_PIXELS]; // q and w, [pair][pixel]
shared vec3 gradients[TILE_PIXELS];
shared float partial[TILE_PIXELS * PICTURE_MOMENTS]; // [pair][part][moment]
shared uint tile_end;

// Adds what a pixel says of a splat at distance d from its centre: q, and w G.
void add(inout float sums[PICTURE_MOMENTS], float q, vec3 w, vec2 d) {
    vec2 first = q * d;
    sums[0] += w.x;
    sums[1] += w.y;
    sums[2] += w.z;
    sums[3] += q;
    sums[4] += first.x;
    sums[5] += first.y;
    sums[6] += first.x * d.x;
    sums[7] += first.x * d.y;
    sums[8] += first.y * d.y;
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint tile = gl_WorkGroupID.x;
    uint columns = (p.size.x + PICTURE_TILE - 1) / PICTURE_TILE;
    vec2 corner = vec2(uvec2(tile % columns, tile / columns) * PICTURE_TILE) + 0.5;
    uvec2 pixel = uvec2(corner) + uvec2(lane % PICTURE_TILE, lane / PICTURE_TILE);
    vec2 place = vec2(pixel) + 0.5;
    uint first = starts[tile], end = starts[tile + 1], farthest = first;
    vec3 gradient[ROWS];
    float rest[ROWS]; // C · G of what is behind
    float passed[ROWS];
    uint shown[ROWS];
    for (uint row = 0; row < ROWS; ++row) {
        gradient[row] = vec3(0.0);
        rest[row] = 0.0;
        passed[row] = 1.0;
        shown[row] = first;
        if (pixel.x < p.size.x && pixel.y + row < p.size.y) {
            uint at = (pixel.y + row) * p.size.x + pixel.x;
            gradient[row] = picture_gradient[at];
            rest[row] = dot(picture[at].rgb, gradient[row]);
            shown[row] = ends[at];
        }
        farthest = max(farthest, shown[row]);
    }
    if (GROUP != 8) gradients[lane] = gradient[0];
    if (lane == 0) tile_end = first;
    barrier();
    atomicMax(tile_end, farthest);
    barrier();
    uint last = tile_end;
    for (uint base = first; base < last; base += TAKEN) {
        uint count = min(TAKEN, last - base);
        barrier();
        if (lane < count) taken[lane] = picture_splats[pair_splats[pairs[base + lane]]];
        barrier();
        for (uint k = 0; k < count; ++k) {
            PictureSplat s = taken[k];
            float sums[PICTURE_MOMENTS] = float[PICTURE_MOMENTS](0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
            for (uint row = 0; row < ROWS; ++row) {
                vec2 d = place + vec2(0.0, row) - s.centre;
                float whole = picture_opacity(s, d);
                float opacity = min(whole, MOST_OPACITY);
                bool is_shown = base + k < shown[row] && opacity >= LEAST_OPACITY;
                opacity = is_shown ? opacity : 0.0;
                float own = dot(s.colour, gradient[row]);
                float w = opacity * passed[row];
                rest[row] -= w * own;
                float q = opacity * (passed[row] * own - rest[row] / (1.0 - opacity));
                q = whole < MOST_OPACITY ? q : 0.0;
                passed[row] *= 1.0 - opacity;
                if (GROUP == 8) {
                    add(sums, q, w * gradient[row], d);
                } else {
                    left[k * TILE_PIXELS + lane] = vec2(q, w);
                }
            }
            if (GROUP == 8)
                for (uint m = 0; m < PICTURE_MOMENTS; ++m) partial[(k * PARTS + lane) * PICTURE_MOMENTS + m] = sums[m];
        }
        barrier();
        if (GROUP != 8) {
            uint k = lane / PARTS, part = lane % PARTS;
            float sums[PICTURE_MOMENTS] = float[PICTURE_MOMENTS](0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
            if (k < count) {
                for (uint i = part; i < TILE_PIXELS; i += PARTS) {
                    vec2 r = left[k * TILE_PIXELS + i];
                    vec2 d = corner + vec2(i % PICTURE_TILE, i / PICTURE_TILE) - taken[k].centre;
                    add(sums, r.x, r.y * gradients[i], d);
                }
            }
            for (uint m = 0; m < PICTURE_MOMENTS; ++m) partial[lane * PICTURE_MOMENTS + m] = sums[m];
            barrier();
        }
        for (uint i = lane; i < count * PICTURE_MOMENTS; i += GROUP) {
            uint pair = i / PICTURE_MOMENTS, m = i % PICTURE_MOMENTS;
            float sum = 0.0;
            for (uint l = 0; l < PARTS; ++l) sum += partial[(pair * PARTS + l) * PICTURE_MOMENTS + m];
            moments[pairs[base + pair] * PICTURE_MOMENTS + m] = sum;
        }
    }
    // No pixel shows what is behind.
    for (uint i = lane; i < (end - last) * PICTURE_MOMENTS; i += GROUP)
        moments[pairs[last + i / PICTURE_MOMENTS] * PICTURE_MOMENTS + i % PICTURE_MOMENTS] = 0.0;
}
