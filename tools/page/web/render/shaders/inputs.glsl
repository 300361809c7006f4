// What the engine's shaders read from buffers, here from images: the build makes a call of `name_at(i)` of each
// `name[i]`. Rows are 4096 texels long.
uniform highp usampler2D look_points_image, look_integrals_image, visible_before_image;
uniform highp usampler2D places_image, distances_image;
uniform highp sampler2D gradient_factors_image, appearances_image, look_rows_image;

ivec2 texel_of(uint i) { return ivec2(i & 4095u, i >> 12); }
uvec2 look_points_at(uint i) { return texelFetch(look_points_image, texel_of(i), 0).xy; }
uvec4 look_integrals_at(uint i) { return texelFetch(look_integrals_image, texel_of(i), 0); }
uint visible_before_at(uint i) { return texelFetch(visible_before_image, texel_of(i), 0).x; }
uint places_at(uint i) { return texelFetch(places_image, texel_of(i), 0).x; }
uint distances_at(uint i) { return texelFetch(distances_image, texel_of(i), 0).x; }
float gradient_factors_at(uint i) { return texelFetch(gradient_factors_image, texel_of(i), 0).x; }

// Visibility masks of headsets are not used here.
uint patches_at(uint i) { return i - i; }

Appearance appearances_at(uint i) {
    vec4 rest = texelFetch(appearances_image, ivec2(1, i), 0);
    return Appearance(texelFetch(appearances_image, ivec2(0, i), 0), rest.x, uint(rest.y), uint(rest.z));
}

// The row of a function: that of the scene from uniforms, others as far as they differ from it.
Look look_rows_at(uint i) {
    Look row = look_scene;
    if (i != 0u) {
        vec4 entries = texelFetch(look_rows_image, ivec2(0, i), 0), rest = texelFetch(look_rows_image, ivec2(1, i), 0);
        row.first = entries.x;
        row.inverse_step = entries.y;
        row.last = entries.z;
        row.integral_unit = entries.w;
        row.inverse_gradient_step = rest.x;
        row.offset = uint(rest.y);
    }
    return row;
}
