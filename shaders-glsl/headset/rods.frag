#version 460
// Rods are lit from the eye, so that their edges are dark before a light background. What faces away is not
// drawn: where there is no picture of depth, it would be drawn over what faces the eye.
#include "light.glsl"
layout(constant_id = 0) const uint LINEAR = 0u; // whether the target turns light into sRGB by itself
layout(location = 0) in vec3 colour;
layout(location = 1) in float facing;
layout(location = 0) out vec4 result;

void main() {
    if (facing <= 0.0) discard;
    vec3 lit = colour * (0.3 + 0.7 * min(facing, 1.0));
    result = vec4(LINEAR == 1u ? light_of(lit) : lit, 1.0);
}
