// One eye: where it is and what it sees. Eye space: x to the right, y up, z the distance along the viewing
// direction, mm.
#ifndef VIEW_GLSL
#define VIEW_GLSL

// Nothing nearer to the eye is shown, mm.
const float NEAREST = 1.0;
#extension GL_EXT_scalar_block_layout : require

// See types.rs.
struct View {
    vec3 eye;
    vec3 right;
    vec3 up;
    vec3 forward;
    vec4 tangents; // of the left, right, upper and lower edge of the picture
};

vec3 turned(View v, vec3 d) {
    return vec3(dot(v.right, d), dot(v.up, d), dot(v.forward, d));
}

// x/z and y/z of the ray through a place of the picture, which is given in pixels from the upper left corner.
vec2 ray_tangents(View v, vec2 place, uvec2 size) {
    vec2 part = place / vec2(size);
    return vec2(mix(v.tangents.x, v.tangents.y, part.x), mix(v.tangents.z, v.tangents.w, part.y));
}

// The ray through tangents: a point at depth z is eye + z * this.
vec3 ray_direction(View v, vec2 t) {
    return t.x * v.right + t.y * v.up + v.forward;
}

#endif
