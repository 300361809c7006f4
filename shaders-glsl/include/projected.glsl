// A splat as one eye sees it.
//
// With the ray's tangents t (x/z, y/z), the splat's centre at tangents c and depth m, and a plane at depth z,
// let
//   s = (z - m) / z,  d = t - c.   Then   x - mean = z (d, 0) + z s (c, 1)   in eye space, and
//   u = R (s, d.x, d.y),  q = z^2 |u|^2
// with R triangular: `along` is its first row, `across` the rest, (r11, r12, r22). So q is exact in
// perspective, all that depends on the splat alone is done once, and the plane only enters through s and z^2.
// Whitened, and relative to the centre, so that neither anisotropy nor distance costs digits.
#ifndef PROJECTED_GLSL
#define PROJECTED_GLSL
#extension GL_EXT_scalar_block_layout : require

// See types.rs.
struct Projected {
    vec2 centre;
    float depth;
    float reach;
    vec3 along;
    vec3 across;
    float amplitude;
    float intensity;
};

#endif
