#version 460
// What the eyes see, one or both side by side, each as large as fits and in its proportions, in numbers of
// sRGB.
#extension GL_EXT_scalar_block_layout : require
layout(constant_id = 0) const uint LINEAR = 0u; // whether what the eyes see is light where it is sampled
layout(push_constant, scalar) uniform MirrorParams {
    vec2 window; // pixels
    vec2 eye;    // pixels
    uint first;  // layer
    uint count;  // layers
} p;
layout(binding = 0) uniform sampler2DArray eyes;
layout(location = 0) out vec4 result;

// Numbers of sRGB from light (IEC 61966-2-1).
vec3 srgb_of(vec3 light) {
    vec3 dark = 12.92 * light, bright = 1.055 * pow(max(light, vec3(0.0)), vec3(1.0 / 2.4)) - 0.055;
    return mix(bright, dark, lessThanEqual(light, vec3(0.0031308)));
}

void main() {
    vec2 cell = vec2(p.window.x / float(p.count), p.window.y);
    float column = floor(gl_FragCoord.x / cell.x);
    vec2 within = gl_FragCoord.xy - vec2(column * cell.x, 0.0);
    float shrunk = max(p.eye.x / cell.x, p.eye.y / cell.y);
    vec2 at = (within - 0.5 * cell) * shrunk / p.eye + 0.5;
    vec3 colour = vec3(0.0);
    if (all(greaterThanEqual(at, vec2(0.0))) && all(lessThan(at, vec2(1.0)))) {
        colour = textureLod(eyes, vec3(at, float(p.first) + column), 0.0).rgb;
    }
    result = vec4(LINEAR == 1u ? srgb_of(colour) : colour, 1.0);
}
