#version 460
// The forward pass, equations (1) and (2) with a peak-1 kernel: W = Σ α κ(q), V^ = Σ α κ(q) c / (W + ε).
// A gather: 8 invocations own a cell of 2^3 samples and walk the pairs that reach it in splat order, so two runs add the
// same numbers in the same order. Intensities are relative to the background, so a sample that no splat reaches has
// the background exactly.
#include "splat.glsl"
#include "kernel.glsl"
#include "brick.glsl"
layout(local_size_x = 8) in;
layout(push_constant, scalar) uniform RasterParams { Grid grid; uint first_cell; float epsilon; } p;
layout(scalar, binding = 0) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 1) readonly buffer Values { uint values[]; };
layout(scalar, binding = 2) readonly buffer CellMasks { uint cell_masks[]; };
layout(scalar, binding = 3) readonly buffer Footprints { Footprint footprints[]; };
layout(scalar, binding = 4) readonly buffer BrickCoordinates { uvec3 brick_coordinates[]; };
layout(scalar, binding = 5) writeonly buffer Reconstructions { Reconstruction reconstructions[]; };

void main() {
    uint cell = p.first_cell + gl_WorkGroupID.x;
    uint slot = cell >> 6;
    uint morton = (cell & 63u) * 8u + gl_LocalInvocationIndex;
    vec3 x = vec3(brick_coordinates[p.grid.first_slot + slot] * 8u + brick_voxel(morton)) + p.grid.offset;
    float weight = 0.0;
    float sum = 0.0;
    uint start = starts[slot];
    uint end = starts[slot + 1];
    uint from = mask_block(start, slot) * 64 + (cell & 63u);
    for (uint first = start; first < end; first += 32) {
        uint mask = cell_masks[from];
        from += 64;
        while (mask != 0) {
            uint i = first + uint(findLSB(mask));
            mask &= mask - 1;
            Footprint f = footprints[values[i]];
            float w = f.opacity * kernel_value(whitened_square(f, x - f.mean));
            weight += w;
            sum += w * f.intensity;
        }
    }
    reconstructions[cell * 8 + gl_LocalInvocationIndex] = Reconstruction(weight, sum / (weight + p.epsilon));
}
