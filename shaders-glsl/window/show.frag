#version 460
// A picture over its background; beside the split, another. Pictures hold premultiplied display-referred
// colour.
#include "show.glsl"
#include "light.glsl"
layout(constant_id = 0) const uint LINEAR = 0u; // whether the target turns light into sRGB by itself
layout(binding = 0) uniform sampler2DArray first_picture;
layout(binding = 1) uniform sampler2DArray second_picture;
layout(location = 0) noperspective in vec2 place;
layout(location = 0) out vec4 result;

// What is shown of a picture at a place, as parts of its shown edges. Nothing beyond them bleeds in.
vec4 shown_of(sampler2DArray picture, vec2 at, vec2 part, uint layer) {
    vec2 most = part - 0.5 / vec2(textureSize(picture, 0).xy);
    return textureLod(picture, vec3(min(at * part, most), float(layer)), 0.0);
}

void main() {
    vec2 at = (place - p.picture.xy) / (p.picture.zw - p.picture.xy);
    vec4 colour = vec4(0.0);
    if (all(greaterThanEqual(at, vec2(0.0))) && all(lessThan(at, vec2(1.0)))) {
        if (place.x < p.split) colour = shown_of(first_picture, at, p.first_part, p.first);
        else colour = shown_of(second_picture, at, p.second_part, p.second);
    }
    vec3 shown = clamp(colour.rgb + (1.0 - colour.a) * p.background.rgb, 0.0, 1.0);
    result = vec4(LINEAR == 1u ? light_of(shown) : shown, 1.0);
}
