#version 460
// Colour and texture are premultiplied sRGB and are multiplied as they are, as egui means them. One draw for
// all panels: what lies outside a panel's clip rectangle is dropped here.
#include "light.glsl"
layout(constant_id = 0) const uint LINEAR = 0u; // whether the target turns light into sRGB by itself
layout(binding = 3) uniform sampler2DArray glyphs;
layout(location = 0) in vec2 place;
layout(location = 1) in vec2 texel;
layout(location = 2) in vec4 colour;
layout(location = 3) flat in vec4 clip;
layout(location = 0) out vec4 result;

void main() {
    if (any(lessThan(place, clip.xy)) || any(greaterThanEqual(place, clip.zw))) discard;
    result = colour * textureLod(glyphs, vec3(texel, 0.0), 0.0);
    if (LINEAR == 1u && result.a > 0.0) result.rgb = light_of(result.rgb / result.a) * result.a;
}
