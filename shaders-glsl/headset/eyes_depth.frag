#version 460
// As eyes.frag, and how far away it is: the mean depth of what an eye sees, as depth buffers have it, so that
// a runtime can move the picture with the head. What is hardly seen is as far as can be.
#include "eyes.glsl"
#include "light.glsl"
layout(binding = 0) uniform sampler2DArray rendered;
layout(binding = 1) uniform sampler2DArray depths; // the mean times the opacity, mm
layout(location = 0) noperspective in vec2 place;
layout(location = 0) out vec4 result;

const float SEEN = 0.05; // least opacity that has a depth

// Colour at a place of a layer; gives the mean depth times the opacity, and the opacity. Between two surfaces
// there is no depth: it is the nearest texel's, not a mean of several.
vec2 seen_at(vec2 at, int layer, out vec4 colour) {
    colour = textureLod(rendered, vec3(at, float(layer)), 0.0);
    ivec3 texel = ivec3(at * vec2(textureSize(depths, 0).xy), layer);
    return vec2(texelFetch(depths, texel, 0).r, texelFetch(rendered, texel, 0).a);
}

void main() {
    vec4 inset = p.insets[gl_ViewIndex];
    float share = FOVEATED == 1u ? inset_share(place, inset) : 0.0;
    vec4 colour = vec4(0.0);
    vec2 found = vec2(0.0); // mean depth times opacity, opacity
    if (share < 1.0) found = seen_at(texture_place(place), gl_ViewIndex, colour);
    if (share > 0.0) {
        vec4 within;
        found = mix(found, seen_at(inset_place(place, inset), gl_ViewIndex + 2, within), share);
        colour = mix(colour, within, share);
    }
    float opacity = found.y;
    float z = max(found.x / max(opacity, SEEN), p.range.x);
    float near = p.range.x, far = p.range.y;
    gl_FragDepth = opacity < SEEN ? 1.0 : clamp(far * (z - near) / (z * (far - near)), 0.0, 1.0);
    colour += (1.0 - colour.a) * p.background;
    colour = marked(place, clamp(colour, 0.0, 1.0));
    if (LINEAR == 1u && colour.a > 0.0) colour.rgb = light_of(colour.rgb / colour.a) * colour.a;
    result = colour;
}
