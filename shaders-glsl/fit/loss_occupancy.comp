#version 460
// λ/2 Σ r^2 over the ROI and its shell: r is what the saturating occupancy O = W / (W + w0) is farther from M
// than the tolerance (Vapnik's ε-insensitive error, squared); parameter is w0. W need not be flat: large inside
// and small outside is enough. dO/dW = w0 / (W + w0)^2.
#include "loss.glsl"

void loss_term(Target wanted, Reconstruction got, out vec2 value_weight, out Adjoint adjoint) {
    float inverse = 1.0 / (got.weight + p.parameter);
    float error = got.weight * inverse - wanted.occupancy;
    float r = sign(error) * max(abs(error) - p.tolerance, 0.0);
    value_weight = vec2(r * r, 1.0);
    adjoint = Adjoint(0.0, p.weight * r * p.parameter * inverse * inverse);
}
