#version 460
// λ/2 Σ n m^^k with the predicted mask m^ = 1 - exp(-W) and the power k (the parameter, 1 or 2): what leaks
// out of the ROI. n is 1 - M, or [M <= region] where the region has a threshold. The mean is Σ n m^^k / Σ n;
// the divisor is known before the fit, and the host has it in λ. dm^/dW = exp(-W).
#include "loss.glsl"

void loss_term(Target wanted, Reconstruction got, out vec2 value_weight, out Adjoint adjoint) {
    float outside = p.region < 0.0 ? 1.0 - wanted.occupancy : (wanted.occupancy > p.region ? 0.0 : 1.0);
    float predicted = predicted_mask(got.weight);
    bool squared = p.parameter > 1.5;
    value_weight = vec2(outside * (squared ? predicted * predicted : predicted), outside);
    adjoint = Adjoint(0.0, 0.5 * p.weight * outside * (squared ? 2.0 * predicted : 1.0) * exp(-got.weight));
}
