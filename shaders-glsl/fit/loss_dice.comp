#version 460
// λ/2 (1 - (2 I + s) / (S + s)), the Dice loss between what is predicted, p, and what is wanted, t:
// I = Σ p t, S = Σ p + Σ t over the samples of the region (below 0: all that take part) of all chunks; overlap_sums
// and sum_triples have summed them before. s, the parameter, is the smoothing; with twice that of Dice it is
// Tversky's loss of equal weights.
//   dL/dp = λ/2 (-2 t / (S + s) + (2 I + s) / (S + s)^2)        dm^/dW = exp(-W)
// Value and weight of a sample are p + t - 2 p t, written as what only one of both has, and p + t: the
// quotient of their sums is 1 - 2 I / S.
#define QUANTITY_CONSTANT 4
#include "loss.glsl"
layout(scalar, binding = 6) readonly buffer Overlap { vec3 overlap[]; }; // [0]: I, Σ p, Σ t

void loss_term(Target wanted, Reconstruction got, out vec2 value_weight, out Adjoint adjoint) {
    value_weight = vec2(0.0);
    adjoint = Adjoint(0.0, 0.0);
    if (!(wanted.occupancy > p.region)) return;
    vec2 both = compared(wanted, got, p.low);
    float transmitted = QUANTITY == QUANTITY_MASK ? exp(-got.weight) : 1.0 - both.x; // 1 - p
    value_weight = vec2(both.x * (1.0 - both.y) + both.y * transmitted, both.x + both.y);
    float s = overlap[0].y + overlap[0].z + p.parameter;
    float half_slope = 0.0; // of the loss by p; nothing to overlap, nothing to move
    if (s > 0.0) half_slope = ((overlap[0].x + 0.5 * p.parameter) / s - both.y) / s;
    if (QUANTITY == QUANTITY_MASK) adjoint.weight = p.weight * half_slope * transmitted;
    else adjoint.value = p.weight * half_slope;
}
