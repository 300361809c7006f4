#version 460
// λ/2 Σ t ln (t / p) over the region (below 0: over all samples that take part), the divergence of Kullback
// and Leibler of what is predicted, p, from what is wanted, t, each kept in 1e-7..1, beyond which there is no
// slope.
//   dL/dp = -λ/2 t / p        dm^/dW = exp(-W)
#define QUANTITY_CONSTANT 4
#include "loss.glsl"

const float LEAST = 1e-7;

void loss_term(Target wanted, Reconstruction got, out vec2 value_weight, out Adjoint adjoint) {
    float inside = wanted.occupancy > p.region ? 1.0 : 0.0;
    vec2 both = compared(wanted, got, p.low);
    vec2 kept = clamp(both, LEAST, 1.0);
    value_weight = inside * vec2(kept.y * log(kept.y / kept.x), 1.0);
    float slope = both.x == kept.x ? -0.5 * p.weight * inside * kept.y / kept.x : 0.0;
    adjoint = Adjoint(0.0, 0.0);
    if (QUANTITY == QUANTITY_MASK) adjoint.weight = slope * exp(-got.weight);
    else adjoint.value = slope;
}
