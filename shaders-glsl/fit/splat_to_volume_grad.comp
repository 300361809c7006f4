#version 460
// The backward pass: dL/d(parameters) of each splat from the folded adjoints (A, H) of the samples in its support.
// A gather: one invocation owns a splat and walks its rows, each over just the interval that lies in the support.
//
//   h = (A c + H),  e = -2 dκ/dq,  d = x - μ,  S0 = Σ h κ,  S1 = α Σ h e d,  S2 = α Σ h e d d^T,  C0 = α Σ A κ
//   dL/dμ = P S1 (P = U^T U, U the whitening matrix);  dL/dln s_k = (U S2 U^T)_kk
//   dL/dω: with B = U S2 U^T (whitened), the antisymmetric part scaled by s_i/s_j - s_j/s_i (see below)
//   dL/dlogit = α (1 - α) S0;  dL/dc = C0
#include "splat.glsl"
#include "kernel.glsl"
#include "brick.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform GradParams { Grid grid; uint first_splat; uint splat_count; uint accumulate; } p;
layout(scalar, binding = 0) readonly buffer Splats { Splat splats[]; };
layout(scalar, binding = 1) readonly buffer Footprints { Footprint footprints[]; };
layout(scalar, binding = 2) readonly buffer Slots { uint slots[]; };
layout(scalar, binding = 3) readonly buffer Adjoints { Adjoint adjoints[]; };
layout(scalar, binding = 4) buffer Gradients { SplatGrad gradients[]; };

void main() {
    uint i = p.first_splat + gl_GlobalInvocationID.x;
    if (i >= p.splat_count) return;
    Footprint f = footprints[i];
    vec3 mean = f.mean - p.grid.offset;
    float support = support_q();
    float s0 = 0.0, c0 = 0.0;
    vec3 s1 = vec3(0.0);
    vec3 diagonal = vec3(0.0);     // S2: xx, yy, zz
    vec3 off_diagonal = vec3(0.0); // S2: yz, zx, xy
    ivec3 first, last;
    sample_box(f, p.grid, first, last);
    for (int z = first.z; z <= last.z; ++z) {
        float dz = float(z) - mean.z;
        Plane plane = plane_at(f, dz, support);
        float y0, y1;
        if (!plane_rows(f, plane, mean.y, y0, y1)) continue;
        ivec2 rows = indices(y0, y1, first.y, last.y);
        for (int y = rows.x; y <= rows.y; ++y) {
            float dy = float(y) - mean.y;
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
            uint brick = 0xFFFFFFFFu, slot = NO_SLOT;
            for (int x = row_x.x; x <= row_x.y; ++x) {
                if (uint(x >> 3) != brick) {
                    brick = uint(x >> 3);
                    slot = slots[row_brick + brick] - p.grid.first_slot;
                }
                if (slot >= p.grid.slot_count) continue;
                Adjoint g = adjoints[slot * 512 + (yz | spread3(uint(x) & 7u))];
                float dx = float(x) - mean.x;
                float u = f.t_x.x * dx + shift;
                vec2 k = kernel_value_slope(u * u + rest);
                float h = g.value * f.intensity + g.weight;
                s0 += h * k.x;
                c0 += g.value * k.x;
                float he = h * k.y;
                r0 += he;
                r1 += he * dx;
                r2 += he * dx * dx;
            }
            s1 += vec3(r1, r0 * dy, r0 * dz);
            diagonal += vec3(r2, r0 * dy * dy, r0 * dz * dz);
            off_diagonal += vec3(r0 * dy * dz, r1 * dz, r1 * dy);
        }
    }
    Splat s = splats[i];
    mat3 whiten = whitening(s);
    mat3 s2 = mat3(diagonal.x, off_diagonal.z, off_diagonal.y,
                   off_diagonal.z, diagonal.y, off_diagonal.x,
                   off_diagonal.y, off_diagonal.x, diagonal.z);
    mat3 b = whiten * s2 * transpose(whiten); // b_ij = (R^T S2 R)_ij / (s_i s_j)
    vec3 ln_s = s.log_scale;
    // A rotation by ω in the splat's own axes changes u_i by ω_k (s_j/s_i) u_j: dL/dω_k = b_ij (s_i/s_j - s_j/s_i).
    vec3 ratio = exp(vec3(ln_s.y - ln_s.z, ln_s.z - ln_s.x, ln_s.x - ln_s.y));
    SplatGrad g;
    g.mean = f.opacity * (transpose(whiten) * (whiten * s1));
    g.log_scale = f.opacity * vec3(b[0][0], b[1][1], b[2][2]);
    g.rotation = f.opacity * vec3(b[1][2], b[2][0], b[0][1]) * (ratio - 1.0 / ratio);
    g.opacity_logit = f.opacity * (1.0 - f.opacity) * s0;
    g.intensity = f.opacity * c0;
    if (p.accumulate != 0) {
        SplatGrad before = gradients[i];
        g.mean += before.mean;
        g.log_scale += before.log_scale;
        g.rotation += before.rotation;
        g.opacity_logit += before.opacity_logit;
        g.intensity += before.intensity;
    }
    gradients[i] = g;
}
