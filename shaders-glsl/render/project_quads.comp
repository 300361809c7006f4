#version 460
// The quads of the active splats, one for each view, and their place in the order that all views share: back
// to front along the mean of the viewing directions, which for parallel eyes is exact for both (by the
// distance from the middle of the eyes it would be for none). One invocation owns a splat. A splat that no
// view shows is sorted behind all others and not counted; so is one whose centre a clip plane cuts away.
#define VISIBILITY_BINDING 16
#include "appearance.glsl"
#include "visibility.glsl"
#include "rows.glsl"
#include "look.glsl"
#include "quad.glsl"
#include "harmonics.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 0) const uint CORNERS = 6;  // vertices of a quad, see alpha.glsl
layout(constant_id = 1) const uint STANDARD = 0; // 1: colour and opacity are the splat's own
layout(constant_id = 2) const uint SHADED = 0;   // 1: with the gradient's light
layout(constant_id = 3) const uint PACKED = 0;   // 1: 16 bytes a splat
layout(constant_id = 4) const uint OBJECTS = 0;  // 1: objects have tints and opacities
layout(constant_id = 5) const uint HIDDEN = 0;   // 1: what no eye sees is left out
layout(push_constant, scalar) uniform QuadParams {
    uvec2 size;
    vec3 centre;
    float radius;
    uint view_count;
    uint splat_count;
    uint coefficients;
    PackedRange range;
} p;
layout(scalar, binding = 4) readonly buffer Rows { uvec4 rows[]; };
layout(scalar, binding = 5) readonly buffer Chunks { PackedChunk chunks[]; };
layout(scalar, binding = 6) readonly buffer Centres { Centre centres[]; };
layout(scalar, binding = 7) readonly buffer Harmonics { uint harmonic_halves[]; };
layout(scalar, binding = 8) readonly buffer Active { uint active_splats[]; };
layout(scalar, binding = 9) readonly buffer ActiveCount { uint active_count[]; };
layout(scalar, binding = 10) writeonly buffer Quads { Quad quads[]; };
layout(scalar, binding = 11) writeonly buffer Keys { uint keys[]; };
layout(scalar, binding = 12) writeonly buffer Values { uint values[]; };
layout(scalar, binding = 13) buffer Arguments { uint arguments[]; }; // vertices, instances, first vertex, first instance
layout(scalar, binding = 14) readonly buffer ActiveObjects { uint active_objects[]; };
layout(scalar, binding = 15) readonly buffer Appearances { Appearance appearances[]; };
layout(scalar, binding = 17) readonly buffer Media { vec4 media[]; }; // extinction times colour, extinction, 1/mm

Splat splat_at(uint i) {
    if (PACKED == 1) return unpack(rows[i], chunks[i / PACKED_CHUNK], p.range);
    return full_splat(rows[3 * i], rows[3 * i + 1], rows[3 * i + 2]);
}

// Bits of the sort key: steps of 1/260,000 of the scene.
const uint ORDER_BITS = 18;
const uint LAST = (1u << ORDER_BITS) - 1; // key of what is not seen
const Quad UNSEEN = Quad(vec2(0.0), vec3(0.0), 0.0, 0.0, 0.0, vec3(0.0));

// Sets centre, axes and depth; gives √6/√A, half of the length of ray in the support, mm.
float project(View v, Splat s, vec3 mean, inout Quad r) {
    // R of the QR decomposition of the whitening, by the columns along the ray, along x and along y
    // (Gram-Schmidt).
    mat3 axes = rotation_matrix(s.rotation);
    vec3 e0 = turned(v, axes[0]), e1 = turned(v, axes[1]), e2 = turned(v, axes[2]);
    vec3 wide = vec3(e0.x, e1.x, e2.x), high = vec3(e0.y, e1.y, e2.y), deep = vec3(e0.z, e1.z, e2.z);
    vec3 inverse = exp(-s.log_scale);
    vec2 tangents = mean.xy / mean.z;
    vec3 a = (wide * tangents.x + high * tangents.y + deep) * inverse, b = wide * inverse, c = high * inverse;
    float along = length(a);
    vec3 e = a / along;
    b -= dot(e, b) * e;
    c -= dot(e, c) * e;
    float bb = length(b);
    e = b / bb;
    float bc = dot(e, c);
    float cc = length(c - bc * e);
    // From tangents to the picture, both axes from -1 to 1.
    vec2 scale = 2.0 / vec2(v.tangents.y - v.tangents.x, v.tangents.w - v.tangents.z);
    r.centre = (tangents - v.tangents.xz) * scale - 1.0;
    r.axes = 2.4494897 / mean.z * vec3(scale.x / bb, -scale.x * bc / (bb * cc), scale.y / cc);
    r.depth = mean.z;
    return 2.4494897 * length(vec3(tangents, 1.0)) / along;
}

// Axes of the ellipse whose covariance on the picture is larger by 0.3 pixels² along x and along y.
vec3 widened(vec3 axes) {
    vec2 pixel = 2.0 / vec2(p.size);
    vec2 more = 6.0 * 0.3 * pixel * pixel;
    float xx = dot(axes.xy, axes.xy) + more.x;
    float xy = axes.y * axes.z;
    float zz = sqrt(axes.z * axes.z + more.y);
    float y = xy / zz;
    return vec3(sqrt(xx - y * y), y, zz);
}

// Colour of a standard splat, seen along a unit vector.
vec3 own_colour(uint splat, vec3 direction) {
    float basis[16] = harmonics(direction);
    vec3 colour = vec3(0.5);
    for (uint k = 0; k < p.coefficients; ++k) {
        for (uint channel = 0; channel < 3; ++channel) {
            uint at = (splat * p.coefficients + k) * 3 + channel;
            colour[channel] += basis[k] * unpackHalf2x16(harmonic_halves[at >> 1])[at & 1];
        }
    }
    return max(colour, 0.0);
}

// Whether no eye sees any of a rectangle around a place of the picture, from -1 to 1, and of the pixels
// beside it, which samplers mix in.
bool unseen(uint view, vec2 centre, vec2 half_size) {
    vec2 reach = half_size + 2.0 / vec2(p.size);
    vec2 low = (centre - reach + 1.0) * (0.5 * float(PATCHES)), high = (centre + reach + 1.0) * (0.5 * float(PATCHES));
    vec2 last = vec2(float(PATCHES - 1));
    return all_hidden(view, uvec2(clamp(low, vec2(0.0), last)), uvec2(clamp(high, vec2(0.0), last)));
}

// The splat as a view shows it. `look` has colour and extinction, the object's appearance in them.
Quad quad_of(uint view, uint splat, Splat s, vec4 look, Appearance object) {
    Quad r = UNSEEN;
    View v = views[view];
    vec3 mean = turned(v, s.mean - v.eye);
    if (!(mean.z > NEAREST)) return r;
    float half_path = project(v, s, mean, r);
    if (STANDARD == 1) {
        r.thickness = object.opacity / (1.0 + exp(-s.opacity_logit));
        if (!(r.thickness > LEAST_OPACITY)) return UNSEEN;
        r.edge = sqrt(log(r.thickness / LEAST_OPACITY) * (1.0 / 3.0));
        r.axes = widened(r.axes);
        r.colour = tinted(own_colour(splat, normalize(s.mean - v.eye)), object.tint);
    } else {
        r.thickness = look.a * 1.1780972 * half_path; // 3π/8
        if (!(r.thickness > LEAST_DEPTH)) return UNSEEN;
        r.edge = sqrt(1.0 - sqrt(LEAST_DEPTH / r.thickness));
        r.colour = look.rgb;
        if (SHADED == 1) {
            Centre f = centres[splat];
            vec3 gradient = turned(v, f.slope - look_rows[0].dark * f.occupancy_slope);
            r.colour = look_lit(look.rgb, gradient, mean, look_source(v), 1.0);
        }
    }
    vec2 half_size = r.edge * vec2(length(r.axes.xy), abs(r.axes.z));
    if (any(greaterThan(abs(r.centre) - half_size, vec2(1.0)))) return UNSEEN;
    if (HIDDEN == 1 && unseen(view, r.centre, half_size)) return UNSEEN;
    return r;
}

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i == 0) arguments[1] = 1;
    if (i >= min(active_count[0], p.splat_count)) return;
    uint splat = active_splats[i];
    Splat s = splat_at(splat);
    bool kept = true;
    for (uint k = 0; k < look_rows[0].plane_count; ++k) {
        vec4 plane = look_rows[0].planes[k];
        if (dot(plane.xyz, s.mean) + plane.w < 0.0) kept = false;
    }
    Appearance object = Appearance(vec4(0.0), 1.0, 1, 0);
    if (OBJECTS == 1) object = appearances[active_objects[i]];
    vec4 look = vec4(0.0);
    if (STANDARD == 0) {
        vec4 medium = media[splat];
        look = vec4(min(medium.rgb / medium.a, 1.0), medium.a);
        if (OBJECTS == 1) {
            look.rgb = tinted(look.rgb, object.tint);
            // As a factor of the opacity per mm, like the occupancy.
            if (object.opacity < 1.0) look.a = -log(1.0 - object.opacity * (1.0 - exp(-look.a)));
        }
    }
    bool seen = false;
    for (uint view = 0; view < p.view_count; ++view) {
        Quad quad = UNSEEN;
        if (kept) quad = quad_of(view, splat, s, look, object);
        quads[view * p.splat_count + i] = quad;
        if (quad.edge > 0.0) seen = true;
    }
    vec3 forward = views[0].forward + views[p.view_count - 1].forward;
    float part = 0.5 + 0.5 * dot(forward, p.centre - s.mean) / (p.radius * max(length(forward), 1e-6));
    uint key = LAST;
    if (seen) {
        key = uint(clamp(part, 0.0, 1.0) * float(LAST - 1));
        atomicAdd(arguments[0], CORNERS);
    }
    keys[i] = key;
    values[i] = i;
}
