#version 460
// The forward pass, equations (1) and (2) with a peak-1 kernel: W = Σ α κ(q), V^ = Σ α κ(q) c / (W + ε).
// A gather: one workgroup owns a block of 4^3 samples of a brick, one invocation a sample; it walks the brick's
// pairs in splat order, so two runs add the same numbers in the same order. Intensities are relative to the
// background, so a sample that no splat reaches has the background exactly.
#include "splat.glsl"
#include "kernel.glsl"
#include "brick.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform RasterParams { Grid grid; uint first_block; float epsilon; } p;
layout(scalar, binding = 0) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 1) readonly buffer Values { uint values[]; };
layout(scalar, binding = 2) readonly buffer Cells { uvec2 cells[]; };
layout(scalar, binding = 3) readonly buffer Footprints { Footprint footprints[]; };
layout(scalar, binding = 4) readonly buffer BrickCoordinates { uvec3 brick_coordinates[]; };
layout(scalar, binding = 5) writeonly buffer Reconstructions { Reconstruction reconstructions[]; };

void main() {
    uint block = p.first_block + gl_WorkGroupID.x;
    uint slot = block >> 3;
    uint cell = (block & 3u) * 8u + (gl_LocalInvocationIndex >> 3);
    uint morton = (block & 7u) * 64u + gl_LocalInvocationIndex;
    vec3 x = vec3(brick_coordinates[p.grid.first_slot + slot] * 8u + brick_voxel(morton)) + p.grid.offset;
    bool upper = (block & 4u) != 0;
    uint any_cell = 0xFFu << ((block & 3u) * 8u);
    float weight = 0.0;
    float sum = 0.0;
    uint end = starts[slot + 1];
    for (uint i = starts[slot]; i < end; ++i) {
        uint mask = upper ? cells[i].y : cells[i].x;
        if ((mask & any_cell) == 0) continue; // the same for the whole workgroup
        if (((mask >> cell) & 1u) == 0) continue;
        Footprint f = footprints[values[i]];
        vec3 d = x - f.mean;
        vec3 u = f.column_x * d.x + f.column_y * d.y + f.column_z * d.z;
        float w = f.opacity * kernel_value(dot(u, u));
        weight += w;
        sum += w * f.intensity;
    }
    reconstructions[slot * 512 + morton] = Reconstruction(weight, sum / (weight + p.epsilon));
}
