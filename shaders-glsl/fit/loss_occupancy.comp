#version 460
// λ/2 Σ (O - M)^2 with the saturating occupancy O = W / (W + w0) over the ROI and its shell; parameter is w0.
// W need not be flat: large inside and small outside is enough. dO/dW = w0 / (W + w0)^2.
#include "loss.glsl"

void loss_term(Target wanted, Reconstruction got, out vec2 value_weight, out Adjoint adjoint) {
    float inverse = 1.0 / (got.weight + p.parameter);
    float r = got.weight * inverse - wanted.occupancy;
    value_weight = vec2(r * r, 1.0);
    adjoint = Adjoint(0.0, p.weight * r * p.parameter * inverse * inverse);
}
