// Brick arithmetic. A brick is 8^3 samples; inside it samples lie in Morton order, so that 8 neighbours in
// memory are a cell of 2^3 and 64 are a block of 4^3.
#ifndef BRICK_GLSL
#define BRICK_GLSL

// Cells of a brick.
const uint CELLS = 64;

// Spreads 3 bits to every third place: abc -> a00b00c.
uint spread3(uint v) {
    return (v & 1u) | ((v & 2u) << 2) | ((v & 4u) << 4);
}

// Gathers every third bit of 9.
uint gather3(uint v) {
    return (v & 1u) | ((v >> 2) & 2u) | ((v >> 4) & 4u);
}

// Place in the brick -> (x, y, z) in 0..8.
uvec3 brick_voxel(uint morton) {
    return uvec3(gather3(morton), gather3(morton >> 1), gather3(morton >> 2));
}

uint brick_index(uvec3 brick, uvec3 bricks) {
    return (brick.z * bricks.y + brick.y) * bricks.x + brick.x;
}

// Samples that lie in the box of a footprint: first and last index on each axis, empty when first > last. The
// box is widened a little, so that rounding never cuts a sample off: what lies outside the support has κ = 0.
void sample_box(Footprint f, Grid grid, out ivec3 first, out ivec3 last) {
    vec3 m = f.mean - grid.offset;
    vec3 e = f.extent + 1e-3;
    vec3 top = vec3(grid.bricks * 8u) - 1.0;
    // Clamped as floats: a huge or non-finite box must not overflow an integer.
    first = ivec3(clamp(ceil(m - e), vec3(0.0), top + 1.0));
    last = ivec3(clamp(floor(m + e), vec3(-1.0), top));
}

// The support of a footprint cut at one plane (fixed d.z): an ellipse, whose rows are asked for one after the
// other.
struct Plane {
    float dz;
    float rest;  // support - u.z^2: what is left for u.x^2 + u.y^2
    float v;     // u.y at d.y = 0
};

Plane plane_at(Footprint f, float dz, float support) {
    float w = f.t_z * dz;
    return Plane(dz, support - w * w, f.t_y.y * dz);
}

// The rows of the plane that meet the support: a closed interval of y; false when there is none.
// `mean_y` counts from the samples.
bool plane_rows(Footprint f, Plane p, float mean_y, out float y0, out float y1) {
    float reach = sqrt(max(p.rest, 0.0));
    float inverse = 1.0 / f.t_y.x;
    y0 = mean_y - (p.v + reach) * inverse;
    y1 = mean_y - (p.v - reach) * inverse;
    return p.rest > 0.0;
}

// The samples of one row (fixed d.y and d.z) that lie in the support: a closed interval of x before clamping
// to the grid, empty (x0 > x1) when the row misses it. `mean_x` counts from the samples.
void row_interval(Footprint f, Plane p, float dy, float mean_x, out float x0, out float x1) {
    float v = f.t_y.x * dy + p.v;
    float rest = p.rest - v * v;
    float inverse = 1.0 / f.t_x.x;
    float half_width = rest > 0.0 ? sqrt(rest) * inverse : -1.0;
    float middle = mean_x - (f.t_x.y * dy + f.t_x.z * p.dz) * inverse;
    x0 = middle - half_width;
    x1 = middle + half_width;
}

// First and last index of a closed interval, widened by a little so that rounding never cuts a sample off,
// inside first ..= last. Clamped as floats: a huge interval must not overflow an integer.
ivec2 indices(float from, float to, int first, int last) {
    return ivec2(max(int(ceil(clamp(from - 1e-3, -1e6, 1e6))), first), min(int(floor(clamp(to + 1e-3, -1e6, 1e6))), last));
}

// Where the cell masks of a slot begin, in blocks of CELLS words: enough room for every 32 pairs begun,
// whatever the number of pairs of the slots before.
uint mask_block(uint first_pair, uint slot) {
    return first_pair / 32 + slot;
}

#endif
