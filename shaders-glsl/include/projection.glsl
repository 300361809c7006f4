// From the space of the scene to the picture of an eye, for what is drawn in the room beside the patient.
#ifndef PROJECTION_GLSL
#define PROJECTION_GLSL
#include "view.glsl"

// Clip coordinates of a place, mm. Its depth is as in eyes_depth.frag, with `range` the distances along the
// viewing direction of depths 0 and 1, mm; nearer than the range, and behind the eye, nothing is drawn.
vec4 projected_place(View view, vec3 at, vec2 range) {
    vec3 seen = turned(view, at - view.eye);
    // From tangents to the picture, whose y runs down; z is the distance along the viewing direction.
    vec2 low = vec2(view.tangents.x, view.tangents.z), high = vec2(view.tangents.y, view.tangents.w);
    vec2 part = (2.0 * seen.xy - (low + high) * seen.z) / (high - low);
    float depth = range.y * (seen.z - range.x) / (range.y - range.x);
    return vec4(part, min(depth, seen.z), seen.z);
}

#endif
