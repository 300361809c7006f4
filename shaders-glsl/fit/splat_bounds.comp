#version 460
// Activates the parameters of one splat an invocation: footprint (triangular whitening, amplitude, the box of
// the support) and the number of bricks of this chunk that the box touches.
#include "splat.glsl"
#include "kernel.glsl"
#include "brick.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform SplatParams { Grid grid; uint splat_count; uint capacity; vec3 stretch; } p;
layout(scalar, binding = 0) readonly buffer Splats { Splat splats[]; };
layout(scalar, binding = 1) readonly buffer Slots { uint slots[]; };
layout(scalar, binding = 2) writeonly buffer Footprints { Footprint footprints[]; };
layout(scalar, binding = 3) writeonly buffer PairCounts { uint pair_counts[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.splat_count) return;
    Splat s = splats[i];
    mat3 axes = rotation_matrix(s.rotation); // a unit quaternion: the optimiser and the readers see to it
    vec3 scale = exp(s.log_scale);
    Footprint f;
    f.mean = s.mean;
    f.amplitude = kernel_peak(s.log_scale) * (1.0 / (1.0 + exp(-s.opacity_logit)));
    f.intensity = s.intensity;
    // Columns of S^-1 R^T, orthogonalised one after the other (modified Gram-Schmidt).
    mat3 columns = whitening(s, p.stretch);
    vec3 column_x = columns[0], column_y = columns[1], column_z = columns[2];
    float xx = length(column_x);
    vec3 e = column_x / xx;
    float xy = dot(e, column_y), xz = dot(e, column_z);
    column_y -= xy * e;
    column_z -= xz * e;
    float yy = length(column_y);
    e = column_y / yy;
    float yz = dot(e, column_z);
    column_z -= yz * e;
    f.t_x = vec3(xx, xy, xz);
    f.t_y = vec2(yy, yz);
    f.t_z = length(column_z);
    vec3 a = axes[0] * scale.x, b = axes[1] * scale.y, c = axes[2] * scale.z;
    f.extent = min(p.stretch * sqrt(support_q() * (a * a + b * b + c * c)), vec3(kernel_reach()));
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
