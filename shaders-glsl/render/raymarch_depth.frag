#version 460
// As raymarch.frag, with the depth.
#extension GL_EXT_multiview : require
#include "march.glsl"
layout(early_fragment_tests) in;
layout(location = 0) out vec4 colour;
layout(location = 1) out float weighted_depth;

void main() {
    Gathered gathered = march(gl_FragCoord.xy, uint(gl_ViewIndex), !gl_HelperInvocation);
    colour = gathered.colour;
    weighted_depth = gathered.depth;
}
