#version 460
// λ/2 Σ (1 - M) m^ with the predicted mask m^ = 1 - exp(-W), over the ROI and its shell: what leaks out of the ROI. The
// mean is Σ (1 - M) m^ / Σ (1 - M); the divisor is known before the fit, and the host has it in λ. dm^/dW = exp(-W).
#include "loss.glsl"

void loss_term(Target wanted, Reconstruction got, out vec2 value_weight, out Adjoint adjoint) {
    float outside = 1.0 - wanted.occupancy;
    value_weight = vec2(outside * predicted_mask(got.weight), outside);
    adjoint = Adjoint(0.0, 0.5 * p.weight * outside * exp(-got.weight));
}
