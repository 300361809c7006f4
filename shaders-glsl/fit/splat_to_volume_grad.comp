#version 460
// The backward pass: the moments of the loss gradient over the support of each splat, from the folded
// adjoints (A, H). A gather: 8 invocations own a splat, each takes every eighth row of the box and walks just
// the interval of it that lies in the support; the eight sums are added in a fixed order.
//
//   h = A c + H,  e = -2 dκ/dq,  d = x - μ:   S0 = Σ h κ,  C0 = Σ A κ,  S1 = Σ h e d,  S2 = Σ h e d d^T
// What these sums mean for the parameters is moments_to_grad's business.
//
// A workgroup owns one splat (GROUP = 8: its loads are uniform, for CPU drivers) or eight (GROUP = 64: for
// GPUs). engine/passes/src/workgroup_shape.rs has the choice.
#include "splat.glsl"
#include "kernel.glsl"
#include "brick.glsl"
#include "storage.glsl"
layout(local_size_x_id = 1) in;
layout(constant_id = 1) const uint GROUP = 64;
layout(push_constant, scalar) uniform GradParams { Grid grid; uint first_splat; uint splat_count; uint accumulate; } p;
layout(scalar, binding = 0) readonly buffer Footprints { Footprint footprints[]; };
layout(scalar, binding = 1) readonly buffer Slots { uint slots[]; };
layout(scalar, binding = 2) readonly buffer Adjoints { uint adjoints[]; };
layout(scalar, binding = 3) buffer MomentRows { float moments[]; }; // [splat][S0, C0, S1 xyz, S2 xx yy zz yz zx xy]

Adjoint load_adjoint(uint i) {
    if (STORAGE == STORAGE_MIXED) {
        vec2 halves = unpackHalf2x16(adjoints[i]);
        return Adjoint(halves.x, halves.y);
    }
    return Adjoint(uintBitsToFloat(adjoints[2 * i]), uintBitsToFloat(adjoints[2 * i + 1]));
}

const uint LANES = 8;
shared float partial[MOMENTS * GROUP]; // [invocation][moment]

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint i = p.first_splat + gl_WorkGroupID.x;
    if (GROUP != LANES) {
        lane = gl_LocalInvocationIndex % LANES;
        i = p.first_splat + (gl_WorkGroupID.x * GROUP + gl_LocalInvocationIndex) / LANES;
    }
    // Invocations behind the last splat walk it again up to the barrier, which all must reach, and write
    // nothing.
    Footprint f = footprints[min(i, p.splat_count - 1)];
    vec3 mean = f.mean - p.grid.offset;
    float support = support_q();
    float s0 = 0.0, c0 = 0.0;
    vec3 s1 = vec3(0.0);
    vec3 diagonal = vec3(0.0);     // S2: xx, yy, zz
    vec3 off_diagonal = vec3(0.0); // S2: yz, zx, xy
    ivec3 first, last;
    sample_box(f, p.grid, first, last);
    ivec3 size = max(last - first + 1, ivec3(0));
    int rows = size.y * size.z;
    float inverse_rows = 1.0 / float(max(size.y, 1));
    for (int row = int(lane); row < rows; row += int(LANES)) {
        int row_z = int((float(row) + 0.5) * inverse_rows);
        int y = first.y + row - row_z * size.y;
        int z = first.z + row_z;
        float dy = float(y) - mean.y, dz = float(z) - mean.z;
        Plane plane = plane_at(f, dz, support);
        float x0, x1;
        row_interval(f, plane, dy, mean.x, x0, x1);
        ivec2 row_x = indices(x0, x1, first.x, last.x);
        // u.y and u.z are constant in the row.
        float v = f.t_y.x * dy + plane.v, w = f.t_z * dz;
        float rest = v * v + w * w;
        float shift = f.t_x.y * dy + f.t_x.z * dz;
        // Sums over the row; dy and dz are constant in it.
        float r0 = 0.0, r1 = 0.0, r2 = 0.0;
        uint yz = (spread3(uint(y) & 7u) << 1) | (spread3(uint(z) & 7u) << 2);
        uint row_brick = (uint(z >> 3) * p.grid.bricks.y + uint(y >> 3)) * p.grid.bricks.x;
        // Brick by brick: the boundaries are the same for all rows of a splat.
        for (int brick = first.x >> 3; brick <= last.x >> 3; ++brick) {
            uint slot = slots[row_brick + uint(brick)] - p.grid.first_slot;
            uint base = slot * 512 + yz;
            int x = max(row_x.x, brick * 8);
            int end = slot < p.grid.slot_count ? min(row_x.y, brick * 8 + 7) : -1;
            for (; x <= end; ++x) {
                Adjoint g = load_adjoint(base + spread3(uint(x) & 7u));
                float dx = float(x) - mean.x;
                float u = f.t_x.x * dx + shift;
                vec2 k = kernel_value_slope(u * u + rest);
                float h = g.value * f.intensity + g.weight;
                s0 += h * k.x;
                c0 += g.value * k.x;
                float he = h * k.y;
                r0 += he;
                he *= dx;
                r1 += he;
                r2 += he * dx;
            }
        }
        s1 += vec3(r1, r0 * dy, r0 * dz);
        diagonal += vec3(r2, r0 * dy * dy, r0 * dz * dz);
        off_diagonal += vec3(r0 * dy * dz, r1 * dz, r1 * dy);
    }
    float own[MOMENTS] = float[MOMENTS](s0, c0, s1.x, s1.y, s1.z, diagonal.x, diagonal.y, diagonal.z,
                                  off_diagonal.x, off_diagonal.y, off_diagonal.z);
    for (uint k = 0; k < MOMENTS; ++k) partial[gl_LocalInvocationIndex * MOMENTS + k] = own[k];
    barrier();
    if (i >= p.splat_count) return;
    uint mine = (gl_LocalInvocationIndex - lane) * MOMENTS;
    for (uint k = lane; k < MOMENTS; k += LANES) {
        float sum = p.accumulate != 0 ? moments[i * MOMENTS + k] : 0.0;
        for (uint l = 0; l < LANES; ++l) sum += partial[mine + l * MOMENTS + k];
        moments[i * MOMENTS + k] = sum;
    }
}
