// Corners of the triangles of panels, as egui makes them.
#extension GL_EXT_scalar_block_layout : require
struct PanelVertex {
    vec2 place;  // points, from the upper left corner of the screen
    vec2 texel;  // 0 to 1 in the texture
    uint colour; // premultiplied sRGB, a byte each, red lowest
    uint clip;   // row of the clip rectangles
};
