#version 460
// What was rendered for an eye, over the background, enlarged where it was rendered at a lower resolution. Colour is
// premultiplied and display-referred; a headset that takes sRGB wants it as light.
#include "eyes.glsl"
#include "light.glsl"
layout(constant_id = 0) const uint LINEAR = 0u; // whether the target turns light into sRGB by itself
layout(binding = 0) uniform sampler2DArray rendered;
layout(location = 0) noperspective in vec2 place;
layout(location = 0) out vec4 result;

void main() {
    vec2 at = min(place * p.part, p.most);
    vec4 colour = textureLod(rendered, vec3(at, float(gl_ViewIndex)), 0.0);
    colour += (1.0 - colour.a) * p.background;
    colour = clamp(colour, 0.0, 1.0);
    if (LINEAR == 1u && colour.a > 0.0) colour.rgb = light_of(colour.rgb / colour.a) * colour.a;
    result = colour;
}
