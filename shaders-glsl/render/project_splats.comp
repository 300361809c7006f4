#version 460
// Projects the active splats for every view, and counts the (tile, block) pairs of each. One invocation owns
// a splat of a view. Rows of splats that cannot be seen stay as they are and have no pairs.
#include "kernel.glsl"
#include "rows.glsl"
#include "tiles.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 1) const uint PACKED = 0; // 1: 16 bytes a splat
layout(constant_id = 2) const uint HIDDEN = 0; // 1: parts of tiles that no eye sees get no pairs
layout(push_constant, scalar) uniform ProjectParams { TileGrid grid; PackedRange range; float background; } p;
layout(scalar, binding = 0) readonly buffer Views { View views[]; };
layout(scalar, binding = 1) readonly buffer Rows { uvec4 rows[]; };
layout(scalar, binding = 2) readonly buffer Chunks { PackedChunk chunks[]; };
layout(scalar, binding = 3) readonly buffer Active { uint active_splats[]; };
layout(scalar, binding = 4) readonly buffer ActiveCount { uint active_count[]; };
layout(scalar, binding = 5) writeonly buffer ProjectedRows { Projected projected[]; };
layout(scalar, binding = 6) writeonly buffer Boxes { uvec4 boxes[]; };
layout(scalar, binding = 7) writeonly buffer PairCounts { uint pair_counts[]; };
layout(scalar, binding = 8) readonly buffer HiddenParts { uint hidden_parts[]; };

Splat splat_at(uint i) {
    if (PACKED == 1) return unpack(rows[i], chunks[i / PACKED_CHUNK], p.range);
    return full_splat(rows[3 * i], rows[3 * i + 1], rows[3 * i + 2]);
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.grid.splat_count) return;
    uint at = gl_WorkGroupID.y * p.grid.splat_count + i;
    boxes[at] = uvec4(0);
    pair_counts[at] = 0;
    if (i >= active_count[0]) return;
    View v = views[gl_WorkGroupID.y];
    Splat s = splat_at(active_splats[i]);
    vec3 mean = turned(v, s.mean - v.eye);
    if (!(mean.z > NEAREST)) return;

    // The splat's axes in eye space, and by the components of each: x, y, z.
    mat3 axes = rotation_matrix(s.rotation);
    vec3 scale = exp(s.log_scale);
    vec3 e0 = turned(v, axes[0]), e1 = turned(v, axes[1]), e2 = turned(v, axes[2]);
    vec3 wide = vec3(e0.x, e1.x, e2.x), high = vec3(e0.y, e1.y, e2.y), deep = vec3(e0.z, e1.z, e2.z);
    float support = support_q();
    Projected r;
    r.centre = mean.xy / mean.z;
    r.depth = mean.z;
    r.reach = sqrt(support) * length(deep * scale);
    r.amplitude = kernel_peak(s.log_scale) / (1.0 + exp(-s.opacity_logit));
    r.intensity = s.intensity - p.background;

    // R of the QR decomposition of the whitening, by the columns along the ray, along x and along y
    // (Gram-Schmidt).
    vec3 inverse = exp(-s.log_scale);
    vec3 a = (wide * r.centre.x + high * r.centre.y + deep) * inverse, b = wide * inverse, c = high * inverse;
    float aa = length(a);
    vec3 e = a / aa;
    float ab = dot(e, b), ac = dot(e, c);
    b -= ab * e;
    c -= ac * e;
    float bb = length(b);
    e = b / bb;
    float bc = dot(e, c);
    c -= bc * e;
    r.along = vec3(aa, ab, ac);
    r.across = vec3(bb, bc, length(c));
    projected[at] = r;

    vec2 x = tangent_bounds(wide * scale, deep * scale, mean.x, mean.z, r.reach, support);
    vec2 y = tangent_bounds(high * scale, deep * scale, mean.y, mean.z, r.reach, support);
    uvec4 box = tile_box(p.grid, v, vec4(x, y));
    ivec2 blocks = block_range(p.grid, first_depth(p.grid, v), r.depth, r.reach);
    if (blocks.x > blocks.y) return;
    float g = outline(support, r.depth, r.reach);
    uint tiles = 0;
    for (uint ty = box.y; ty < box.w; ++ty)
        for (uint tx = box.x; tx < box.z; ++tx) {
            uint hidden = 0;
            if (HIDDEN == 1)
                hidden = hidden_parts[(gl_WorkGroupID.y * p.grid.tiles.y + ty) * p.grid.tiles.x + tx];
            if (HIDDEN == 1 && hidden == 255) continue;
            if ((tile_parts(p.grid, v, r, uvec2(tx, ty), g) & ~hidden) != 0) tiles += 1;
        }
    boxes[at] = box;
    pair_counts[at] = tiles * uint(blocks.y - blocks.x + 1);
}
