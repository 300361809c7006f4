// How a splat comes onto a picture: the forward pass and its derivative start from these.
#ifndef PICTURE_AXES_GLSL
#define PICTURE_AXES_GLSL
#include "splat.glsl"
#include "view.glsl"

struct PictureAxes {
    vec3 mean;      // eye space, mm
    vec2 tangents;  // x/z and y/z of the mean
    vec2 focal;     // pixels per tangent
    vec3 turned[3]; // unit vectors along the splat's own axes, eye space
    vec2 axes[3];   // the same on the picture, pixels per mm
    vec3 scale;     // standard deviations, mm
};

PictureAxes picture_axes(Splat s, View v, uvec2 size) {
    PictureAxes r;
    r.mean = turned(v, s.mean - v.eye);
    r.tangents = r.mean.xy / r.mean.z;
    r.focal = vec2(size) / vec2(v.tangents.y - v.tangents.x, v.tangents.w - v.tangents.z);
    r.scale = exp(s.log_scale);
    mat3 own = rotation_matrix(s.rotation);
    for (uint k = 0; k < 3; ++k) {
        r.turned[k] = turned(v, own[k]);
        r.axes[k] = r.focal * (r.turned[k].xy - r.tangents * r.turned[k].z) / r.mean.z;
    }
    return r;
}

// xx, xy, yy of the covariance on the picture, widened, pixels².
vec3 picture_covariance(PictureAxes r, float widening) {
    vec3 sum = vec3(widening, 0.0, widening);
    for (uint k = 0; k < 3; ++k) {
        vec2 a = r.axes[k] * r.scale[k];
        sum += vec3(a.x * a.x, a.x * a.y, a.y * a.y);
    }
    return sum;
}

#endif
