#version 460
// As eyes.frag, and how far away it is: the mean depth of what an eye sees, as depth buffers have it, so that a runtime can
// move the picture with the head. What is hardly seen is as far as can be.
#include "eyes.glsl"
#include "light.glsl"
layout(constant_id = 0) const uint LINEAR = 0u; // whether the target turns light into sRGB by itself
layout(binding = 0) uniform sampler2DArray rendered;
layout(binding = 1) uniform sampler2DArray depths; // the mean times the opacity, mm
layout(location = 0) noperspective in vec2 place;
layout(location = 0) out vec4 result;

const float SEEN = 0.05; // least opacity that has a depth

void main() {
    vec2 at = min(place * p.part, p.most);
    vec4 colour = textureLod(rendered, vec3(at, float(gl_ViewIndex)), 0.0);
    // Between two surfaces there is none: the nearest texel's depth, not a mean of several.
    ivec3 texel = ivec3(at * vec2(textureSize(depths, 0).xy), gl_ViewIndex);
    float opacity = texelFetch(rendered, texel, 0).a;
    float z = max(texelFetch(depths, texel, 0).r / max(opacity, SEEN), p.range.x);
    float near = p.range.x, far = p.range.y;
    gl_FragDepth = opacity < SEEN ? 1.0 : clamp(far * (z - near) / (z * (far - near)), 0.0, 1.0);
    colour += (1.0 - colour.a) * p.background;
    colour = clamp(colour, 0.0, 1.0);
    if (LINEAR == 1u && colour.a > 0.0) colour.rgb = light_of(colour.rgb / colour.a) * colour.a;
    result = colour;
}
