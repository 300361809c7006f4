// Standard splats on a picture, as other programs draw them (Kerbl et al. 2023): what the kernels in picture/
// share. A splat has the opacity α exp(-γ/2) at a distance d from its centre, γ = d · conic d, and the conic is the
// inverse of its covariance on the picture, widened (Zwicker et al. 2001).
#ifndef PICTURE_GLSL
#define PICTURE_GLSL
#extension GL_EXT_scalar_block_layout : require
#include "quad.glsl"

// Edge of a tile of the picture, pixels. One workgroup has a tile.
const uint PICTURE_TILE = 8;
const uint TILE_PIXELS = 64;
// Sums over the pixels of a tile that are kept of each splat in it; see picture_blend_grad.comp.
const uint PICTURE_MOMENTS = 9;
// Splats are sorted by depth in as many steps, which a float tells apart: 24 bits.
const uint DEPTH_STEPS = 0xffffff;
// What is behind is not seen where less than this passes.
const float LEAST_PASSED = 1e-4;

// A splat on a picture. See types/picture.rs.
struct PictureSplat {
    vec2 centre;
    vec3 conic;
    float opacity;
    vec3 colour;
    float depth;
};

// Opacity of a splat at a distance from its centre, before it is cut to 0 or MOST_OPACITY.
float picture_opacity(PictureSplat s, vec2 d) {
    return s.opacity * exp(-0.5 * (s.conic.x * d.x * d.x + s.conic.z * d.y * d.y) - s.conic.y * d.x * d.y);
}

// The tiles that hold the ellipse in which a splat is drawn: first x and y, end x and y.
uvec4 picture_tiles(PictureSplat s, uvec2 size) {
    precise float edge = 2.0 * log(s.opacity / LEAST_OPACITY);
    if (!(edge > 0.0)) return uvec4(0);
    precise float determinant = s.conic.x * s.conic.z - s.conic.y * s.conic.y;
    precise vec2 reach = sqrt(edge * s.conic.zx / determinant);
    // The middles of the pixels that the box holds.
    precise vec2 first = clamp(ceil(s.centre - reach - 0.5), vec2(0.0), vec2(size));
    precise vec2 last = clamp(floor(s.centre + reach - 0.5), vec2(-1.0), vec2(size) - 1.0);
    if (!all(lessThanEqual(first, last))) return uvec4(0);
    return uvec4(uvec2(first) / PICTURE_TILE, uvec2(last) / PICTURE_TILE + 1);
}

// Whether the ellipse in which a splat is drawn reaches the square of the middles of a tile's pixels: the least γ in
// it is at the centre if that is inside, and otherwise on one of the edges.
bool reaches_tile(PictureSplat s, uvec2 tile) {
    precise vec2 low = vec2(tile * PICTURE_TILE) + 0.5 - s.centre, high = low + float(PICTURE_TILE - 1);
    if (all(lessThanEqual(low, vec2(0.0))) && all(greaterThanEqual(high, vec2(0.0)))) return true;
    precise float least = 1e30;
    for (uint side = 0; side < 2; ++side) {
        vec2 at = side == 0 ? low : high;
        precise float y = clamp(-s.conic.y * at.x / s.conic.z, low.y, high.y);
        precise float x = clamp(-s.conic.y * at.y / s.conic.x, low.x, high.x);
        least = min(least, s.conic.x * at.x * at.x + s.conic.z * y * y + 2.0 * s.conic.y * at.x * y);
        least = min(least, s.conic.x * x * x + s.conic.z * at.y * at.y + 2.0 * s.conic.y * x * at.y);
    }
    return least <= 2.0 * log(s.opacity / LEAST_OPACITY);
}

#endif
