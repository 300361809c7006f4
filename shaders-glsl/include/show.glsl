// What show.vert and show.frag share.
#extension GL_EXT_scalar_block_layout : require
layout(push_constant, scalar) uniform ShowParams {
    vec2 window;     // pixels
    vec4 area;       // what is covered: left, top, right, bottom, pixels
    vec4 picture;    // where the picture lies, the same
    vec4 background; // display-referred, opaque
    float split;     // left of this the first picture, from it on the second; pixels
    uint first;      // layer of the first picture
    uint second;     // layer of the second
    vec2 first_part; // edges of what is shown of the first picture, as parts of its own
    vec2 second_part;
} p;
