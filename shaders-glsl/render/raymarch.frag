#version 460
// Marches the ray of a pixel (march.glsl), where faces are marked. What a headset does for fragments, such as
// making fewer at the rim of its field of view, it does for rays so.
#extension GL_EXT_multiview : require
#include "march.glsl"
layout(early_fragment_tests) in;
layout(location = 0) out vec4 colour;

void main() {
    Gathered gathered = march(gl_FragCoord.xy, uint(gl_ViewIndex), !gl_HelperInvocation);
    colour = gathered.colour;
}
