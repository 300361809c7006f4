// How intensities become colour and opacity: the tables of a look. Function 0 is that of the scene, others are of
// objects; each has a row, and its entries from the row's offset on.
// engine/transfer/src/table has the same on the host. LOOK_BINDING is the first of their three places.
#ifndef LOOK_TABLE_GLSL
#define LOOK_TABLE_GLSL
#include "look_row.glsl"

layout(scalar, binding = LOOK_BINDING) readonly buffer LookRows { Look look_rows[]; };
layout(scalar, binding = LOOK_BINDING + 1) readonly buffer LookPoints { uvec2 look_points[]; };
layout(scalar, binding = LOOK_BINDING + 2) readonly buffer LookIntegrals { uvec4 look_integrals[]; };

// The first entry of a function. Where the number is known, so is that of the scene's.
uint look_offset(uint function) {
    return function == 0u ? 0u : look_rows[function].offset;
}

vec4 look_entry(uint i) {
    uvec2 e = look_points[i];
    return vec4(unpackUnorm2x16(e.x), unpackUnorm2x16(e.y).x, unpackHalf2x16(e.y).y);
}

// Colour (not premultiplied) and extinction, 1/mm, at an intensity: those of the nearest entry.
vec4 look_point(uint function, float v) {
    float at = (v - look_rows[function].first) * look_rows[function].inverse_step + 0.5;
    return look_entry(look_offset(function) + uint(clamp(floor(at), 0.0, look_rows[function].last)));
}

// Opacity of a stretch of ray, mm: occupancy is a factor of the opacity per mm, 1 - exp(-extinction), so that
// a faint occupancy stays faint however opaque the transfer function is.
float look_opacity(float extinction, float occupancy, float path) {
    return 1.0 - exp(path * log(1.0 - occupancy * (1.0 - exp(-extinction))));
}

// Mean colour and mean extinction of a segment on which the intensity goes evenly from one value to another.
vec4 look_segment(uint function, float from, float to) {
    uint first = look_offset(function);
    float a = (min(from, to) - look_rows[function].first) * look_rows[function].inverse_step;
    float b = (max(from, to) - look_rows[function].first) * look_rows[function].inverse_step;
    if (b - a < 1.0) return look_point(function, 0.5 * (from + to));
    float last = look_rows[function].last;
    float below = min(b, 0.0) - min(a, 0.0);
    float above = max(b, last) - max(a, last);
    float ca = clamp(a, 0.0, last), cb = clamp(b, 0.0, last);
    uint na = uint(min(floor(ca), last - 1.0)), nb = uint(min(floor(cb), last - 1.0));
    uint ia = first + na, ib = first + nb;
    uvec4 ka = look_integrals[ia], kb = look_integrals[ib];
    vec4 whole = vec4(kb - ka);
    vec4 part = (cb - float(nb)) * vec4(look_integrals[ib + 1u] - kb)
        - (ca - float(na)) * vec4(look_integrals[ia + 1u] - ka);
    vec4 sum = max((whole + part) * look_rows[function].integral_unit, 0.0);
    if (below > 0.0) {
        vec4 e = look_entry(first);
        sum += below * vec4(e.rgb * e.a, e.a);
    }
    if (above > 0.0) {
        vec4 e = look_entry(first + uint(last));
        sum += above * vec4(e.rgb * e.a, e.a);
    }
    if (sum.a <= 0.0) return vec4(0.0);
    return vec4(min(sum.rgb, sum.a) / sum.a, sum.a / (b - a));
}

#endif
