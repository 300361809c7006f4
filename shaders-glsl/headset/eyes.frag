#version 460
// What was rendered for an eye, over the background, enlarged where it was rendered at a lower resolution.
// Colour is premultiplied and display-referred; a headset that takes sRGB wants it as light.
#include "eyes.glsl"
#include "light.glsl"
layout(binding = 0) uniform sampler2DArray rendered;
layout(location = 0) noperspective in vec2 place;
layout(location = 0) out vec4 result;

void main() {
    vec4 inset = p.insets[gl_ViewIndex];
    float share = FOVEATED == 1u ? inset_share(place, inset) : 0.0;
    vec4 colour = vec4(0.0);
    if (share < 1.0) colour = textureLod(rendered, vec3(texture_place(place), float(gl_ViewIndex)), 0.0);
    if (share > 0.0) {
        vec4 within = textureLod(rendered, vec3(inset_place(place, inset), float(gl_ViewIndex + 2)), 0.0);
        colour = mix(colour, within, share);
    }
    colour += (1.0 - colour.a) * p.background;
    colour = marked(place, clamp(colour, 0.0, 1.0));
    if (LINEAR == 1u && colour.a > 0.0) colour.rgb = light_of(colour.rgb / colour.a) * colour.a;
    result = colour;
}
