// How a scene is seen: by a transfer function (look_table.glsl), clipped, and lit. All kernels that show
// something bind the views and the look in these places.
#ifndef LOOK_GLSL
#define LOOK_GLSL
#include "view.glsl"
#define LOOK_BINDING 1
#include "look_table.glsl"

layout(scalar, binding = 0) readonly buffer Views { View views[]; };

// The unit vector towards the key light, in eye space.
vec3 look_source(View v) {
    vec3 light = look_rows[0].light;
    return look_rows[0].light_turns == 1u ? turned(v, light) : light;
}

// Blinn and Phong, by the key light in the direction `source` and the fill light, mirrored from left to right, which has
// no highlight; both sides of a surface are lit alike. `gradient` is that of O (V - dark), `ray` goes from the eye; all
// in eye space. `light` is the share of the light that arrives: what ambient occlusion leaves of it.
vec3 look_lit(vec3 base, vec3 gradient, vec3 ray, vec3 source, float light) {
    float steepness = dot(gradient, gradient);
    if (steepness <= 0.0) return base;
    vec3 normal = gradient * inversesqrt(steepness);
    vec3 halfway = normalize(source - normalize(ray));
    float fill = look_rows[0].fill;
    float diffuse = mix(abs(dot(normal, source)), abs(dot(normal, vec3(-source.x, source.yz))), fill);
    float shine = pow(max(abs(dot(normal, halfway)), 1e-6), look_rows[0].power);
    vec3 lit = base * (look_rows[0].ambient + look_rows[0].diffuse * diffuse) + look_rows[0].specular * shine;
    return min(lit * light, 1.0);
}

// Depths between which a ray is inside all clip planes: eye + z * direction, z from range.x to range.y.
vec2 look_clipped(vec3 eye, vec3 direction, vec2 range) {
    for (uint i = 0u; i < look_rows[0].plane_count; ++i) {
        vec4 plane = look_rows[0].planes[i];
        float at = dot(plane.xyz, eye) + plane.w;
        float slope = dot(plane.xyz, direction);
        if (slope > 0.0) range.x = max(range.x, -at / slope);
        else if (slope < 0.0) range.y = min(range.y, -at / slope);
        else if (at < 0.0) range.y = -1.0;
    }
    return range;
}

#endif
