// Tiles of 16 x 16 pixels, and planes at right angles to the viewing direction. Eight planes times a
// refinement are a block; a (tile, block) is what splats are sorted into. A tile has eight parts of 4 x 8
// pixels.
#ifndef TILES_GLSL
#define TILES_GLSL
#include "view.glsl"
#include "projected.glsl"

// Pixels along the edge of a tile.
const uint TILE = 16;
// Parts of a tile.
const uint PARTS = 8;
// Planes of a block, but for a refinement.
const uint PLANES = 8;
// Bits of a pair that say which projected row it belongs to; the others say which parts of the tile.
const uint ROW_BITS = 24;

// See types.rs.
struct TileGrid {
    uvec2 size;
    uvec2 tiles;
    vec3 centre;
    float radius;
    float spacing;
    uint planes;
    uint blocks;
    uint splat_count;
    uint capacity;
};

// Depth at which the first slab begins. Plane k is at first_depth + (k + 1/2) spacing.
float first_depth(TileGrid g, View v) {
    return max(dot(v.forward, g.centre - v.eye) - g.radius, NEAREST);
}

// First and last block with a plane that a splat reaches; none where first > last.
ivec2 block_range(TileGrid g, float first, float depth, float reach) {
    float last_plane = float(g.planes * g.blocks - 1);
    float from = max(ceil((depth - reach - first) / g.spacing - 0.5), 0.0);
    float to = min(floor((depth + reach - first) / g.spacing - 0.5), last_plane);
    if (!(from <= to)) return ivec2(1, 0);
    return ivec2(uint(from) / g.planes, uint(to) / g.planes);
}

// Tangents between which an ellipsoid of extent `reach` around `mean` is seen, along one axis of the picture.
// The planes through the eye that touch it satisfy (n . mean)^2 = Q n . cov n; relative to the centre's
// tangent nothing cancels. `part` are the components along this axis of the ellipsoid's axes, `deep` those
// along the depth, scaled with sigma.
vec2 tangent_bounds(vec3 part, vec3 deep, float at, float depth, float reach, float support) {
    float nearest = depth - reach;
    if (nearest <= NEAREST) {
        // It reaches the eye's plane: a box from there on, seen from all of its corners.
        float half_size = sqrt(support * dot(part, part));
        float farthest = depth + reach;
        float low = at - half_size, high = at + half_size;
        return vec2(min(low / NEAREST, low / farthest), max(high / NEAREST, high / farthest));
    }
    float c = at / depth;
    vec3 lateral = part - c * deep;
    float a = depth * depth - reach * reach;
    float b = support * dot(lateral, deep);
    float root = sqrt(max(b * b + a * support * dot(lateral, lateral), 0.0));
    return c + vec2(-b - root, -b + root) / a;
}

// Where the rays of the picture's pixel places go; inverse of ray_tangents along each axis.
vec2 tangents_to_places(View v, float axis_low, float axis_high, vec2 bounds, float size) {
    vec2 places = (bounds - axis_low) / (axis_high - axis_low) * size;
    return vec2(min(places.x, places.y), max(places.x, places.y));
}

// Which of the eight parts of a tile the outline of a splat may meet, one bit each: 4 columns of 4 pixels, 2
// rows of 8. The outline is |across| <= g: (r11 x + r12 y)^2 + (r22 y)^2 <= g^2 in tangents relative to the
// centre.
uint tile_parts(TileGrid grid, View v, Projected s, uvec2 tile, float g) {
    uint parts = 0;
    float slant = s.across.y / s.across.z;
    float lean = inversesqrt(1.0 + slant * slant);
    for (uint row = 0; row < 2; ++row) {
        // Places of pixel centres in this row of parts.
        vec2 low = vec2(tile * TILE + uvec2(0, row * 8)) + 0.5;
        float y0 = ray_tangents(v, low, grid.size).y - s.centre.y;
        float y1 = ray_tangents(v, low + vec2(0.0, 7.0), grid.size).y - s.centre.y;
        float u0 = max(s.across.z * min(y0, y1), -g);
        float u1 = min(s.across.z * max(y0, y1), g);
        if (u0 > u1) continue;
        // x = (-slant u ± sqrt(g^2 - u^2)) / r11; its extremes are where the ellipse leans furthest, or at
        // the ends.
        float ur = clamp(-slant * lean * g, u0, u1);
        float ul = clamp(slant * lean * g, u0, u1);
        float right = (-slant * ur + sqrt(max(g * g - ur * ur, 0.0))) / s.across.x + s.centre.x;
        float left = (-slant * ul - sqrt(max(g * g - ul * ul, 0.0))) / s.across.x + s.centre.x;
        vec2 places = tangents_to_places(v, v.tangents.x, v.tangents.y, vec2(left, right), float(grid.size.x)) - low.x;
        // A little wider than computed, so that rounding loses nothing.
        float slack = 1e-3 * (places.y - places.x) + 1e-3;
        float first = max(ceil(places.x - slack), 0.0), last = min(floor(places.y + slack), 15.0);
        if (first > last) continue;
        uint columns = (2u << (uint(last) / 4)) - (1u << (uint(first) / 4));
        parts |= columns << (4 * row);
    }
    return parts;
}

// Tiles that the box around a splat's outline touches: first and one behind the last.
uvec4 tile_box(TileGrid g, View v, vec4 bounds) {
    vec2 x = tangents_to_places(v, v.tangents.x, v.tangents.y, bounds.xy, float(g.size.x));
    vec2 y = tangents_to_places(v, v.tangents.z, v.tangents.w, bounds.zw, float(g.size.y));
    // From places to the pixels whose centres lie between them, a little wider.
    vec2 low = clamp(vec2(x.x, y.x) - 0.51, vec2(0.0), vec2(g.size));
    vec2 high = clamp(vec2(x.y, y.y) + 0.51, vec2(0.0), vec2(g.size));
    if (!(low.x < high.x && low.y < high.y)) return uvec4(0);
    return uvec4(uvec2(low) / TILE, min((uvec2(ceil(high)) + TILE - 1) / TILE, g.tiles));
}

// Outline of a splat in tangents relative to its centre: |across| <= this.
float outline(float support, float depth, float reach) {
    return sqrt(support) / max(depth - reach, NEAREST);
}

#endif
