// What of a look is not a table.
#ifndef LOOK_ROW_GLSL
#define LOOK_ROW_GLSL
#extension GL_EXT_scalar_block_layout : require

// Most clip planes at a time; a box takes six.
const uint CLIP_PLANES = 8u;

// Entries of a table of factors of the opacity over the gradient magnitude.
const uint GRADIENT_ENTRIES = 256u;

// See types.rs.
struct Look {
    float first;
    float inverse_step;
    float last;
    float integral_unit;
    float dark;
    float ambient;
    float diffuse;
    float specular;
    float power;
    float occlusion;
    float inverse_gradient_step;
    uint plane_count;
    uint offset;
    vec3 light;
    float fill;
    uint light_turns;
    vec4 planes[CLIP_PLANES];
};

#endif
