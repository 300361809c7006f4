#version 460
// The derivative of the blended picture: for each pair of a tile and a splat, sums over the pixels of the tile. One
// workgroup owns a tile. It takes the pairs in groups: first an invocation a pixel walks the group from front to back,
// then four invocations a pair add up what the pixels left, in a fixed order, so that no float is added atomically.
//
// With G the derivative of the loss by a pixel's colour C, T what passes in front of a splat and w = α T:
//   dL/dα = T c · G - (C · G - Σ w c · G up to here) / (1 - α),   q = α dL/dα (0 where α is cut),
// and the sums are w G (3), q, q d (2), q d d^T (xx, xy, yy), d from the splat's centre to the pixel.
#include "picture.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform PictureBlendGradParams { uvec2 size; } p;
layout(scalar, binding = 0) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 1) readonly buffer Pairs { uint pairs[]; };
layout(scalar, binding = 2) readonly buffer PairSplats { uint pair_splats[]; };
layout(scalar, binding = 3) readonly buffer PictureSplats { PictureSplat picture_splats[]; };
layout(scalar, binding = 4) readonly buffer Picture { vec4 picture[]; };
layout(scalar, binding = 5) readonly buffer Ends { uint ends[]; };
layout(scalar, binding = 6) readonly buffer PictureGradient { vec3 picture_gradient[]; };
layout(scalar, binding = 7) writeonly buffer PictureMoments { float moments[]; }; // [pair][PICTURE_MOMENTS]

const uint GROUP = 16;
const uint LANES = 4; // invocations that add up a pair
shared PictureSplat group[GROUP];
shared vec2 left[GROUP * TILE_PIXELS]; // q and w, [pair][pixel]
shared vec3 gradients[TILE_PIXELS];
shared float partial[TILE_PIXELS * PICTURE_MOMENTS];
shared uint tile_end;

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint tile = gl_WorkGroupID.x;
    uint columns = (p.size.x + PICTURE_TILE - 1) / PICTURE_TILE;
    vec2 corner = vec2(uvec2(tile % columns, tile / columns) * PICTURE_TILE) + 0.5;
    uvec2 pixel = uvec2(corner) + uvec2(lane % PICTURE_TILE, lane / PICTURE_TILE);
    vec2 place = vec2(pixel) + 0.5;
    uint first = starts[tile], end = starts[tile + 1], shown = first;
    vec3 gradient = vec3(0.0), seen = vec3(0.0);
    if (all(lessThan(pixel, p.size))) {
        uint at = pixel.y * p.size.x + pixel.x;
        gradient = picture_gradient[at];
        seen = picture[at].rgb;
        shown = ends[at];
    }
    gradients[lane] = gradient;
    if (lane == 0) tile_end = first;
    barrier();
    atomicMax(tile_end, shown);
    barrier();
    uint last = tile_end;
    float rest = dot(seen, gradient); // C · G of what is behind
    float passed = 1.0;
    for (uint base = first; base < last; base += GROUP) {
        uint count = min(GROUP, last - base);
        barrier();
        if (lane < count) group[lane] = picture_splats[pair_splats[pairs[base + lane]]];
        barrier();
        for (uint k = 0; k < count; ++k) {
            vec2 r = vec2(0.0);
            if (base + k < shown) {
                PictureSplat s = group[k];
                float whole = picture_opacity(s, place - s.centre);
                float opacity = min(whole, MOST_OPACITY);
                if (opacity >= LEAST_OPACITY) {
                    float own = dot(s.colour, gradient);
                    r.y = opacity * passed;
                    rest -= r.y * own;
                    if (whole < MOST_OPACITY) r.x = opacity * (passed * own - rest / (1.0 - opacity));
                    passed *= 1.0 - opacity;
                }
            }
            left[k * TILE_PIXELS + lane] = r;
        }
        barrier();
        uint k = lane / LANES, part = lane % LANES;
        float sums[PICTURE_MOMENTS] = float[PICTURE_MOMENTS](0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        if (k < count) {
            vec2 centre = group[k].centre;
            for (uint i = part; i < TILE_PIXELS; i += LANES) {
                vec2 r = left[k * TILE_PIXELS + i];
                vec3 w = r.y * gradients[i];
                vec2 d = corner + vec2(i % PICTURE_TILE, i / PICTURE_TILE) - centre;
                vec2 q = r.x * d;
                sums[0] += w.x;
                sums[1] += w.y;
                sums[2] += w.z;
                sums[3] += r.x;
                sums[4] += q.x;
                sums[5] += q.y;
                sums[6] += q.x * d.x;
                sums[7] += q.x * d.y;
                sums[8] += q.y * d.y;
            }
        }
        for (uint m = 0; m < PICTURE_MOMENTS; ++m) partial[lane * PICTURE_MOMENTS + m] = sums[m];
        barrier();
        for (uint i = lane; i < count * PICTURE_MOMENTS; i += TILE_PIXELS) {
            uint pair = i / PICTURE_MOMENTS, m = i % PICTURE_MOMENTS;
            float sum = 0.0;
            for (uint l = 0; l < LANES; ++l) sum += partial[(pair * LANES + l) * PICTURE_MOMENTS + m];
            moments[pairs[base + pair] * PICTURE_MOMENTS + m] = sum;
        }
    }
    // No pixel shows what is behind.
    for (uint i = lane; i < (end - last) * PICTURE_MOMENTS; i += TILE_PIXELS)
        moments[pairs[last + i / PICTURE_MOMENTS] * PICTURE_MOMENTS + i % PICTURE_MOMENTS] = 0.0;
}
