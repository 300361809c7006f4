#version 460
// dL/d(parameters) of a splat from the sums of its pairs, which follow each other. One invocation owns a splat.
//
// With S1 = Σ q d, S2 = Σ q d d^T and the conic K: dL/d(centre) = K S1, dL/d(covariance) = ½ K S2 K. The
// covariance is Σ m m^T over m = s_k a_k, a_k the own axis on the picture (picture_axes.glsl), so
// dL/dm = 2 dL/d(covariance) m.
#include "picture.glsl"
#include "picture_axes.glsl"
#include "harmonics.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform PictureProjectParams {
    View view;
    uvec2 size;
    uint splat_count;
    uint coefficients;
    float nearest;
    float farthest;
    float widening;
} p;
layout(scalar, binding = 0) readonly buffer Splats { Splat splats[]; };
layout(scalar, binding = 1) readonly buffer Harmonics { vec3 harmonics_of[]; };
layout(scalar, binding = 2) readonly buffer PictureSplats { PictureSplat picture_splats[]; };
layout(scalar, binding = 3) readonly buffer Order { uint order[]; };
layout(scalar, binding = 4) readonly buffer PairOffsets { uint pair_offsets[]; }; // in that order
layout(scalar, binding = 5) readonly buffer PictureMoments { float moments[]; };
layout(scalar, binding = 6) writeonly buffer Gradients { SplatGrad gradients[]; };
layout(scalar, binding = 7) writeonly buffer HarmonicGradients { vec3 harmonic_gradients[]; };

// Derivatives of the harmonics by a direction that need not be a unit vector, times weights; polynomials as they stand
// in harmonics.glsl.
vec3 harmonics_slope(vec3 d, float w[16]) {
    float x = d.x, y = d.y, z = d.z;
    float xx = x * x, yy = y * y, zz = z * z;
    vec3 g = vec3(0.0);
    g += w[1] * -0.48860251 * vec3(0.0, 1.0, 0.0);
    g += w[2] * 0.48860251 * vec3(0.0, 0.0, 1.0);
    g += w[3] * -0.48860251 * vec3(1.0, 0.0, 0.0);
    g += w[4] * 1.09254843 * vec3(y, x, 0.0);
    g += w[5] * -1.09254843 * vec3(0.0, z, y);
    g += w[6] * 0.31539157 * vec3(-2.0 * x, -2.0 * y, 4.0 * z);
    g += w[7] * -1.09254843 * vec3(z, 0.0, x);
    g += w[8] * 0.54627422 * vec3(2.0 * x, -2.0 * y, 0.0);
    g += w[9] * -0.59004359 * vec3(6.0 * x * y, 3.0 * (xx - yy), 0.0);
    g += w[10] * 2.89061144 * vec3(y * z, x * z, x * y);
    g += w[11] * -0.45704580 * vec3(-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z);
    g += w[12] * 0.37317633 * vec3(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * xx - 3.0 * yy);
    g += w[13] * -0.45704580 * vec3(4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z);
    g += w[14] * 1.44530572 * vec3(2.0 * x * z, -2.0 * y * z, xx - yy);
    g += w[15] * -0.59004359 * vec3(3.0 * (xx - yy), -6.0 * x * y, 0.0);
    return g;
}

void main() {
    uint rank = gl_GlobalInvocationID.x;
    if (rank >= p.splat_count) return;
    uint i = order[rank];
    SplatGrad g = SplatGrad(vec3(0.0), 0.0, vec3(0.0), vec3(0.0), 0.0);
    // A step whose pairs found no room is void, but what it reads must be there.
    uint first = pair_offsets[rank], end = min(pair_offsets[rank + 1], uint(moments.length()) / PICTURE_MOMENTS);
    if (first >= end) {
        gradients[i] = g;
        for (uint k = 0; k < p.coefficients; ++k) harmonic_gradients[i * p.coefficients + k] = vec3(0.0);
        return;
    }
    float sums[PICTURE_MOMENTS] = float[PICTURE_MOMENTS](0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (uint pair = first; pair < end; ++pair)
        for (uint m = 0; m < PICTURE_MOMENTS; ++m) sums[m] += moments[pair * PICTURE_MOMENTS + m];
    Splat s = splats[i];
    PictureSplat seen = picture_splats[i];
    PictureAxes a = picture_axes(s, p.view, p.size);
    mat2 conic = mat2(seen.conic.x, seen.conic.y, seen.conic.y, seen.conic.z);
    vec2 by_centre = conic * vec2(sums[4], sums[5]);
    mat2 by_covariance = 0.5 * conic * mat2(sums[6], sums[7], sums[7], sums[8]) * conic;
    g.opacity_logit = (1.0 - seen.opacity) * sums[3];

    vec2 by_axes[3];
    vec2 by_tangents = by_centre * a.focal;
    float by_depth = 0.0;
    for (uint k = 0; k < 3; ++k) {
        vec2 m = a.axes[k] * a.scale[k];
        vec2 by_m = 2.0 * by_covariance * m;
        g.log_scale[k] = dot(by_m, m);
        by_axes[k] = by_m * a.scale[k];
        by_tangents -= by_axes[k] * a.focal * a.turned[k].z / a.mean.z;
        by_depth -= dot(by_axes[k], a.axes[k]) / a.mean.z;
    }
    g.rotation = vec3(dot(by_axes[1], a.axes[2]) - dot(by_axes[2], a.axes[1]),
                      dot(by_axes[2], a.axes[0]) - dot(by_axes[0], a.axes[2]),
                      dot(by_axes[0], a.axes[1]) - dot(by_axes[1], a.axes[0]));
    vec3 by_mean = vec3(by_tangents, -dot(by_tangents, a.tangents)) / a.mean.z;
    by_mean.z += by_depth;
    g.mean = by_mean.x * p.view.right + by_mean.y * p.view.up + by_mean.z * p.view.forward;

    // The colour is 0 where it would be negative, whatever its coefficients.
    vec3 by_colour = vec3(sums[0], sums[1], sums[2]);
    for (uint channel = 0; channel < 3; ++channel) if (!(seen.colour[channel] > 0.0)) by_colour[channel] = 0.0;
    vec3 away = s.mean - p.view.eye;
    vec3 direction = normalize(away);
    float basis[16] = harmonics(direction), weights[16];
    for (uint k = 0; k < 16; ++k) weights[k] = 0.0;
    for (uint k = 0; k < p.coefficients; ++k) {
        harmonic_gradients[i * p.coefficients + k] = basis[k] * by_colour;
        weights[k] = dot(by_colour, harmonics_of[i * p.coefficients + k]);
    }
    vec3 slope = harmonics_slope(direction, weights);
    g.mean += (slope - direction * dot(direction, slope)) / length(away);
    gradients[i] = g;
}
