#version 460
// The forward pass, equations (1) and (2): W = Σ a κ(q), V^ = Σ a κ(q) c / (W + ε), a = α times the kernel's
// peak. A gather: 8 invocations own a cell of 2^3 samples, one each, and walk the pairs that reach the cell
// in splat order, so two runs add the same numbers in the same order. Intensities are relative to the
// background: a sample that no splat reaches has the background exactly.
//
// Two things keep the digits however many splats meet. Intensities are summed relative to c0, that of the
// cell's first splat: V^ = c0 + (Σ w (c - c0) - ε c0) / (W + ε), so that where all are equal nothing is left
// to round. And the sums of 32 pairs are added with compensation (Kahan 1965): a million weights of 0.1 in a
// plain float are off by 1 %.
//
// A workgroup owns 8 cells. With GROUP = 64 they go side by side, as GPUs want it. With GROUP = 8 they go one
// after the other: then all loads are uniform, which a CPU driver turns into scalar ones, five times faster
// there. engine/passes/src/workgroup_shape.rs has the choice.
#include "splat.glsl"
#include "kernel.glsl"
#include "brick.glsl"
#include "storage.glsl"
layout(local_size_x_id = 1) in;
layout(constant_id = 1) const uint GROUP = 64;
layout(push_constant, scalar) uniform RasterParams { Grid grid; uint first_cell; float epsilon; } p;
layout(scalar, binding = 0) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 1) readonly buffer PairSplats { uint pair_splats[]; };
layout(scalar, binding = 2) readonly buffer CellMasks { uint cell_masks[]; };
layout(scalar, binding = 3) readonly buffer Footprints { Footprint footprints[]; };
layout(scalar, binding = 4) readonly buffer BrickCoordinates { uvec3 brick_coordinates[]; };
layout(scalar, binding = 5) writeonly buffer Reconstructions { uint reconstructions[]; };

// Cells of a workgroup.
const uint CELLS_PER_GROUP = 8;
// What is less than a normal number some devices flush to zero; on all it counts as nothing.
const float LEAST_WEIGHT = 1.1754944e-38;

// Adds `term` to `total`; `lost` is what rounding has added to it so far. `precise`, or a compiler may cancel
// it out.
void add(inout vec2 total, inout vec2 lost, vec2 term) {
    precise vec2 owed = term - lost;
    precise vec2 next = total + owed;
    precise vec2 added = next - total;
    lost = added - owed;
    total = next;
}

void rasterize(uint cell, uint lane) {
    uint slot = cell / CELLS;
    uint morton = (cell & (CELLS - 1u)) * 8u + lane;
    vec3 x = vec3(brick_coordinates[p.grid.first_slot + slot] * 8u + brick_voxel(morton)) + p.grid.offset;
    vec2 total = vec2(0.0), lost = vec2(0.0); // Σ w, Σ w (c - c0)
    uint start = starts[slot];
    uint end = starts[slot + 1];
    float c0 = 0.0;
    bool begun = false;
    uint from = mask_block(start, slot) * CELLS + (cell & (CELLS - 1u));
    for (uint first = start; first < end; first += 32) {
        uint mask = cell_masks[from];
        from += CELLS;
        if (mask == 0) continue;
        if (!begun) c0 = footprints[pair_splats[first + uint(findLSB(mask))]].intensity;
        begun = true;
        vec2 block = vec2(0.0);
        while (mask != 0) {
            Footprint f = footprints[pair_splats[first + uint(findLSB(mask))]];
            mask &= mask - 1;
            vec3 d = x - f.mean;
            vec3 u = vec3(dot(f.t_x, d), dot(f.t_y, d.yz), f.t_z * d.z);
            float w = within_reach(d, f.extent) ? f.amplitude * kernel_value(dot(u, u)) : 0.0;
            block += vec2(w, w * (f.intensity - c0));
        }
        add(total, lost, block);
    }
    vec2 got = vec2(0.0);
    if (!(total.x < LEAST_WEIGHT)) {
        float divisor = total.x + p.epsilon;
        // The same; where ε outweighs W, V^ is small, and a difference of two c0 would leave few digits of
        // it.
        float value = (total.x * c0 + total.y) / divisor;
        if (total.x > p.epsilon) value = c0 + (total.y - p.epsilon * c0) / divisor;
        got = vec2(total.x, value);
    }
    uint at = cell * 8 + lane;
    if (STORAGE == STORAGE_MIXED) {
        reconstructions[at] = pack_halves(got);
    } else {
        reconstructions[2 * at] = floatBitsToUint(got.x);
        reconstructions[2 * at + 1] = floatBitsToUint(got.y);
    }
}

void main() {
    uint cell = p.first_cell + gl_WorkGroupID.x * CELLS_PER_GROUP;
    if (GROUP == 8) {
        for (uint c = 0; c < CELLS_PER_GROUP; ++c) rasterize(cell + c, gl_LocalInvocationIndex);
    } else {
        rasterize(cell + gl_LocalInvocationIndex / 8, gl_LocalInvocationIndex & 7u);
    }
}
