#version 460
// λ/2 Σ (m^ - M)^2 over the region (below 0: over all samples that take part), m^ = 1 - exp(-W) the predicted
// mask. dm^/dW = exp(-W).
#include "loss.glsl"

void loss_term(Target wanted, Reconstruction got, out vec2 value_weight, out Adjoint adjoint) {
    float inside = wanted.occupancy > p.region ? 1.0 : 0.0;
    float r = predicted_mask(got.weight) - wanted.occupancy;
    value_weight = inside * vec2(r * r, 1.0);
    adjoint = Adjoint(0.0, p.weight * inside * r * exp(-got.weight));
}
