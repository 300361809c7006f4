// What eyes.vert and eyes.frag share.
#extension GL_EXT_multiview : require
#extension GL_EXT_scalar_block_layout : require
layout(push_constant, scalar) uniform EyesParams {
    vec2 part;       // of the picture's edges that were rendered
    vec2 most;       // texture coordinates beyond which a sample would take in what was not
    vec4 background; // display-referred, premultiplied
    vec2 range;      // distances along the viewing direction of depths 0 and 1, mm
} p;
