// What panels.vert and panels.frag share.
#extension GL_EXT_scalar_block_layout : require
struct PanelVertex {
    vec2 place;  // points, from the window's upper left corner
    vec2 texel;  // 0 to 1 in the texture
    uint colour; // premultiplied sRGB, a byte each, red lowest
    uint clip;   // row of the clip rectangles
};
layout(push_constant, scalar) uniform PanelParams {
    vec2 window; // points
} p;
