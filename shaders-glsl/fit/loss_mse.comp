#version 460
// λ/2 Σ m (V^ - V)^2: squared intensity error inside the ROI. m is [M > region], with region = 1/2 for a
// binary mask, since M between voxels is an interpolation and not a doubt, and M itself for a soft one
// (region below 0). With a region the parameter is the weight of its rim, 0 < M <= region.
#include "loss.glsl"

void loss_term(Target wanted, Reconstruction got, out vec2 value_weight, out Adjoint adjoint) {
    float m = wanted.occupancy;
    if (p.region >= 0.0) m = m > p.region ? 1.0 : (m > 0.0 ? p.parameter : 0.0);
    float r = got.value - wanted.value;
    value_weight = vec2(m * r * r, m);
    adjoint = Adjoint(p.weight * m * r, 0.0);
}
