#version 460
// λ/2 (1 - 2 I / S), the Dice loss between the predicted mask m^ = 1 - exp(-W) and M over the ROI and its shell:
// I = Σ m^ M, S = Σ m^ + Σ M, over all samples of all chunks; overlap_sums and sum_triples have summed them before.
//   d(1 - 2 I / S)/dm^ = -2 M / S + 2 I / S^2        dm^/dW = exp(-W)
// Value and weight of a sample are m^ + M - 2 m^ M, written as what only one of both has, and m^ + M: their sums have the
// quotient 1 - 2 I / S.
#include "loss.glsl"
layout(scalar, binding = 4) readonly buffer Overlap { vec3 overlap[]; }; // [0]: I, Σ m^, Σ M

void loss_term(Target wanted, Reconstruction got, out vec2 value_weight, out Adjoint adjoint) {
    float m = wanted.occupancy;
    float predicted = predicted_mask(got.weight);
    float transmitted = exp(-got.weight); // 1 - m^
    value_weight = vec2(predicted * (1.0 - m) + m * transmitted, predicted + m);
    float s = overlap[0].y + overlap[0].z;
    float half_slope = 0.0; // of the loss by m^; nothing to overlap, nothing to move
    if (s > 0.0) half_slope = (overlap[0].x / s - m) / s;
    adjoint = Adjoint(0.0, p.weight * half_slope * transmitted);
}
