// The splat kernel κ(q) of the squared whitened distance q, as a specialisation constant chooses it
// (engine/splat/src/kernel.rs has the same profiles).
#ifndef KERNEL_GLSL
#define KERNEL_GLSL

layout(constant_id = 0) const uint KERNEL = 0;
const uint KERNEL_COMPACT = 0;  // (1 - q/6)^3: smooth end, no exp
const uint KERNEL_GAUSSIAN = 1; // exp(-q/2), cut at 3 sigma: the paper's, and what ordinary viewers draw
const uint KERNEL_DENSITY = 2;  // the same with a peak of 1 / ((2π)^(3/2) s1 s2 s3): of unit integral before the cut
const uint KERNEL_GATED = 3;    // exp(-q/2) times a logistic gate around √q = 1.794, in a cube of 10 voxels around the mean

float support_q() {
    if (KERNEL == KERNEL_COMPACT) return 6.0;
    if (KERNEL == KERNEL_GATED) return 22.982436;
    return 9.0;
}

// Along each axis κ is cut off at this distance from the mean, voxels, wherever the support ends.
float kernel_reach() {
    if (KERNEL == KERNEL_GATED) return 10.0;
    return 1e30;
}

// Whether a sample at d from the mean of a splat whose box has this half size is not cut off; as `sample_box`
// decides.
bool within_reach(vec3 d, vec3 extent) {
    return KERNEL != KERNEL_GATED || all(lessThanEqual(abs(d), extent + 1e-3));
}

// exp(-q/2) σ(z) with z = (1.794 - √(q + 1e-6)) / 0.75, and -2 times its derivative by q.
vec2 gated(float q) {
    float r = sqrt(q + 1e-6);
    float gate = 1.0 / (1.0 + exp((r - 1.794) * (1.0 / 0.75)));
    float k = q < 22.982436 ? exp(-0.5 * q) * gate : 0.0;
    return vec2(k, k * (1.0 + (1.0 - gate) / (0.75 * r)));
}

// The greatest logarithm of a peak.
const float LN_PEAK_MAX = 40.0;

// What α is multiplied with to give the amplitude of w. Through the logarithm, and at most exp(LN_PEAK_MAX):
// the product of scales within their limits leaves the floats.
float kernel_peak(vec3 log_scale) {
    if (KERNEL == KERNEL_DENSITY) return exp(min(-(log_scale.x + log_scale.y + log_scale.z) - 2.7568156, LN_PEAK_MAX));
    return 1.0;
}

// κ(q); 0 outside the support.
float kernel_value(float q) {
    if (KERNEL == KERNEL_COMPACT) {
        float t = max(1.0 - q * (1.0 / 6.0), 0.0);
        return t * t * t;
    }
    if (KERNEL == KERNEL_GATED) return gated(q).x;
    return q < 9.0 ? exp(-0.5 * q) : 0.0;
}

// (κ(q), -2 dκ/dq).
vec2 kernel_value_slope(float q) {
    if (KERNEL == KERNEL_COMPACT) {
        float t = max(1.0 - q * (1.0 / 6.0), 0.0);
        return vec2(t * t * t, t * t);
    }
    if (KERNEL == KERNEL_GATED) return gated(q);
    float k = q < 9.0 ? exp(-0.5 * q) : 0.0;
    return vec2(k, k);
}

#endif
