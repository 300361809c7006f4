// How an object of a scene is shown. Σw of several splats mixes their tints and opacities as it mixes their
// intensities.
#ifndef APPEARANCE_GLSL
#define APPEARANCE_GLSL
#extension GL_EXT_scalar_block_layout : require

// See types.rs.
struct Appearance {
    vec4 tint;
    float opacity;
    uint visible;
    uint function;
};

// A colour of the transfer function with so much of a tint in place of it.
vec3 tinted(vec3 colour, vec4 tint) {
    return colour * (1.0 - tint.a) + tint.rgb;
}

#endif
