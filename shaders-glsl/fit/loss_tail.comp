#version 460
// λ/2 Σ t(V^ - V) inside the ROI: what errors of the intensity weigh beside their square, so that few are far above the
// others. The parameter is s: t = r^4 / (2 s^2) up to 4 s, and from there on its tangent parabola 16 r^2 - 128 s^2, so that
// nothing far off rules the fit. The ROI is that of loss_mse.comp, without its rim.
#include "loss.glsl"

const float MOST = 16.0; // times the derivative of the square

void loss_term(Target wanted, Reconstruction got, out vec2 value_weight, out Adjoint adjoint) {
    float m = wanted.occupancy;
    if (p.region >= 0.0) m = m > p.region ? 1.0 : 0.0;
    float r = got.value - wanted.value;
    float share = r / p.parameter;
    float times = share * share;
    float value = times < MOST ? 0.5 * times * r * r : MOST * (r * r - 0.5 * MOST * p.parameter * p.parameter);
    value_weight = vec2(m * value, m);
    adjoint = Adjoint(p.weight * m * r * min(times, MOST), 0.0);
}
