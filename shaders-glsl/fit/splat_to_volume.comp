#version 460
// The forward pass, equations (1) and (2) with a peak-1 kernel: W = Σ α κ(q), V^ = Σ α κ(q) c / (W + ε).
// A gather: 8 invocations own a cell of 2^3 samples and walk its list of splats in splat order, so two runs add the
// same numbers in the same order. Intensities are relative to the background, so a sample that no splat reaches has
// the background exactly.
//
// CELLS_PER_GROUP: with one cell a workgroup the list is the same for all invocations, which a CPU driver turns into
// scalar loads; GPUs want full workgroups. The workgroup size follows it.
#include "splat.glsl"
#include "kernel.glsl"
#include "brick.glsl"
layout(local_size_x = 8) in;
layout(push_constant, scalar) uniform RasterParams { Grid grid; uint first_cell; float epsilon; } p;
layout(scalar, binding = 0) readonly buffer ListStarts { uint list_starts[]; };
layout(scalar, binding = 1) readonly buffer Lists { uint lists[]; };
layout(scalar, binding = 2) readonly buffer Footprints { Footprint footprints[]; };
layout(scalar, binding = 3) readonly buffer BrickCoordinates { uvec3 brick_coordinates[]; };
layout(scalar, binding = 4) writeonly buffer Reconstructions { Reconstruction reconstructions[]; };

void main() {
    uint cell = p.first_cell + gl_WorkGroupID.x;
    uint slot = cell >> 6;
    uint morton = (cell & 63u) * 8u + gl_LocalInvocationIndex;
    vec3 x = vec3(brick_coordinates[p.grid.first_slot + slot] * 8u + brick_voxel(morton)) + p.grid.offset;
    float weight = 0.0;
    float sum = 0.0;
    uint end = min(list_starts[cell + 1], lists.length());
    for (uint i = list_starts[cell]; i < end; ++i) {
        Footprint f = footprints[lists[i]];
        float w = f.opacity * kernel_value(whitened_square(f, x - f.mean));
        weight += w;
        sum += w * f.intensity;
    }
    reconstructions[cell * 8 + gl_LocalInvocationIndex] = Reconstruction(weight, sum / (weight + p.epsilon));
}
