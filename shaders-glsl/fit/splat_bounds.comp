#version 460
// Activates the parameters of one splat an invocation: footprint (whitening columns S^-1 R^T, alpha, the box of
// the support) and the number of bricks of this chunk that the box touches.
#include "splat.glsl"
#include "kernel.glsl"
#include "brick.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform SplatParams { Grid grid; uint splat_count; uint capacity; } p;
layout(scalar, binding = 0) readonly buffer Splats { Splat splats[]; };
layout(scalar, binding = 1) readonly buffer Slots { uint slots[]; };
layout(scalar, binding = 2) writeonly buffer Footprints { Footprint footprints[]; };
layout(scalar, binding = 3) writeonly buffer PairCounts { uint pair_counts[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.splat_count) return;
    Splat s = splats[i];
    vec4 r = s.rotation; // unit: the optimiser and the readers see to it
    // Columns of R: the axes of the ellipsoid.
    vec3 axis0 = vec3(1.0 - 2.0 * (r.z * r.z + r.w * r.w), 2.0 * (r.y * r.z + r.x * r.w), 2.0 * (r.y * r.w - r.x * r.z));
    vec3 axis1 = vec3(2.0 * (r.y * r.z - r.x * r.w), 1.0 - 2.0 * (r.y * r.y + r.w * r.w), 2.0 * (r.z * r.w + r.x * r.y));
    vec3 axis2 = vec3(2.0 * (r.y * r.w + r.x * r.z), 2.0 * (r.z * r.w - r.x * r.y), 1.0 - 2.0 * (r.y * r.y + r.z * r.z));
    vec3 scale = exp(s.log_scale);
    vec3 inverse = exp(-s.log_scale);
    Footprint f;
    f.mean = s.mean;
    f.opacity = 1.0 / (1.0 + exp(-s.opacity_logit));
    f.intensity = s.intensity;
    f.column_x = vec3(axis0.x, axis1.x, axis2.x) * inverse;
    f.column_y = vec3(axis0.y, axis1.y, axis2.y) * inverse;
    f.column_z = vec3(axis0.z, axis1.z, axis2.z) * inverse;
    vec3 a = axis0 * scale.x, b = axis1 * scale.y, c = axis2 * scale.z;
    f.extent = sqrt(support_q() * (a * a + b * b + c * c));
    footprints[i] = f;

    ivec3 first, last;
    sample_box(f, p.grid, first, last);
    uint count = 0;
    if (all(lessThanEqual(first, last))) {
        uvec3 lo = uvec3(first) >> 3, hi = uvec3(last) >> 3;
        for (uint z = lo.z; z <= hi.z; ++z)
            for (uint y = lo.y; y <= hi.y; ++y)
                for (uint x = lo.x; x <= hi.x; ++x) {
                    uint slot = slots[brick_index(uvec3(x, y, z), p.grid.bricks)];
                    if (slot - p.grid.first_slot < p.grid.slot_count) count += 1;
                }
    }
    pair_counts[i] = count;
}
