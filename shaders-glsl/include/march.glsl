// Marches rays through a volume or a decoded field (medium.glsl): V and O by trilinear sampling, then the
// transfer function, front to back, until no light is left. A ray is cut into cells, and those that can show
// something into parts, each with a sample of its own; a cell's share of the ray is what clip planes and the
// volume's box leave of it, so a homogeneous medium absorbs exactly. Bricks that show nothing are leapt over, as many at a time as their distance to the next one that
// does allows. Where little is added, the light of a part serves for the next one, too.
//
// The rays of a subgroup go together, cell by cell: what they read lies close together, and no ray waits for
// another's brick. What a ray gathers does not depend on its company, since a cell that it could have leapt
// over adds exactly nothing: so it is the same in the kernel (raymarch.comp) and in fragments (raymarch.frag).
#ifndef MARCH_GLSL
#define MARCH_GLSL
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_vote : require
#define VISIBILITY_BINDING 9
#include "visibility.glsl"
#include "look.glsl"
#define MEDIUM_BINDING 4
#include "medium.glsl"

layout(constant_id = 3) const uint COUNTING = 0u; // 1: work is counted, see Gathered
layout(constant_id = 4) const uint SEGMENTS = 0u; // 1: the transfer function is integrated between samples
layout(constant_id = 5) const uint SHADED = 0u;   // 1: with the gradient's light
layout(constant_id = 6) const uint HIDDEN = 0u;   // 1: what no eye sees stays transparent
layout(constant_id = 7) const uint JITTER = 0u;   // 1: each ray's cells are shifted by a random part of a step
layout(constant_id = 8) const uint OCCLUDED = 0u; // 1: less light where much around is opaque; with SHADED
layout(constant_id = 9) const uint GRADED = 0u;   // 1: the opacity depends on the gradient magnitude, too
layout(constant_id = 10) const uint KEPT = 0u;    // 1: gradients are kept for the voxels
layout(push_constant, scalar) uniform RaymarchParams {
    BrickGrid grid;
    vec4 voxel_from_scene[3];
    float first;
    float span;
    uvec2 size;
    float cell;
    uint parts;
    float slack;
    float dark;
    float edge;
} p;
layout(scalar, binding = 8) readonly buffer Distances { uint distances[]; };
// Factors of the opacity over the gradient magnitude, GRADIENT_ENTRIES for each transfer function.
layout(scalar, binding = 10) readonly buffer GradientFactors { float gradient_factors[]; };
// For each entry of the scene's function the number of entries before it at which a function shows something.
layout(scalar, binding = 11) readonly buffer Visible { uint visible_before[]; };
// Where they are kept: of each voxel twice the gradient of O (V - dark) in voxel space.
layout(binding = 12) uniform sampler3D gradients;

// What a ray brings back.
struct Gathered {
    vec4 colour; // premultiplied; or, where work is counted, the work of its subgroup and 1
    float depth; // the mean times the opacity, mm
};

const float FAR = 1e30;
const uint NO_FUNCTION = ~0u;
const float MOST = 8388608.0;       // cells from the eye on; beyond, floats do not count any more
const float FAINT = 1.0 / 4096.0;   // a part that adds less than this finds no light of its own; where gradients are not
const float STRONG = 1.0 / 64.0;    // kept, one that adds more than this always does, others do if their index is even
// Balls of the ambient occlusion: their radii in voxels, and where along each axis the corners of a tetrahedron lie
// whose mean is that of a ball of radius 1 for functions up to the second degree: sqrt(1/5).
const float SMALL_BALL = 4.0;
const float LARGE_BALL = 12.0;
const float BALL_CORNER = 0.4472136;
// Mean opacities of the balls up to which nothing is occluded, so that light which comes from a little below a plain
// surface stays, and from which on all is: that of the inner edge of a box.
const float OPEN = 0.125;
const float CLOSED = 0.5;
// Opacity of a cell from which on it is seen from before alone.
const float HIDING = 0.5;

// V and what opacities leave of O at a place.
vec2 field_at(vec3 at) {
    vec2 found = medium_at(p.grid, at, image_place(p.grid, at));
    if (OBJECTS != 0u) found.y = shown_at(p.grid, at, found.y);
    return vec2(p.first + p.span * found.x, found.y);
}

// The factor of the opacity that a function makes of a gradient magnitude, straight from entry to entry of its table.
float gradient_factor(uint function, float magnitude) {
    float at = min(magnitude * look_rows[function].inverse_gradient_step, float(GRADIENT_ENTRIES - 1u));
    uint low = min(uint(at), GRADIENT_ENTRIES - 2u);
    uint entry = function * GRADIENT_ENTRIES + low;
    return mix(gradient_factors[entry], gradient_factors[entry + 1u], at - float(low));
}

// Colour, and opacity per mm, of what the functions of the objects around a place make of the way from one intensity
// to another and of the gradient magnitude there: the mean of what each makes of it, weighted by what opacities leave of
// its part of O, of which the sum is `shown`.
vec4 objects_shown(vec3 at, vec2 way, float magnitude, float shown) {
    vec3 place = atlas_place(p.grid, at);
    ivec3 low = ivec3(place);
    vec2 label = labels_at(low);
    bool alone = label.y > 0.5;
    Appearance object = object_called(label.x);
    vec4 sum = vec4(0.0), got = vec4(0.0); // colour times opacity, and opacity; what the last function made of it
    uint last = NO_FUNCTION;
    uint corners = alone ? 1u : 8u;
    for (uint corner = 0u; corner < corners; ++corner) {
        if (!alone) {
            Voxel voxel = voxel_at(low, place - vec3(low), corner);
            object = voxel.object;
            shown = shown_of(object, voxel.o);
        }
        if (object.function != last) {
            last = object.function;
            if (SEGMENTS == 1u) got = look_segment(last, way.x, way.y);
            else got = look_point(last, way.y);
            got.a = 1.0 - exp(-got.a);
            if (GRADED == 1u) got.a *= gradient_factor(last, magnitude);
        }
        sum += shown * got.a * vec4(tinted(got.rgb, object.tint), 1.0);
    }
    return sum.a > 0.0 ? vec4(sum.rgb / sum.a, sum.a) : vec4(0.0);
}

// Whether a cell between these V and O can show something: a function does at an intensity between them, or a little
// beyond, since V may go farther between the ends: by the slack or, where it turns after it has changed much from `past`
// on, the start of the cell before, by that less half of what it changes here.
bool could_show(float past, vec2 start, vec2 end) {
    float rise = start.x - past, half_change = 0.5 * abs(end.x - start.x);
    vec2 ends = vec2(min(start.x, end.x) - max(p.slack, -rise - half_change),
        max(start.x, end.x) + max(p.slack, rise - half_change));
    vec2 at = (ends - look_rows[0].first) * look_rows[0].inverse_step;
    vec2 entry = clamp(vec2(floor(at.x), ceil(at.y)), 0.0, look_rows[0].last);
    return max(start.y, end.y) > 0.0 && visible_before[uint(entry.y) + 1u] > visible_before[uint(entry.x)];
}

// O (V - dark)
float excess(vec3 at) {
    vec2 here = field_at(at);
    return here.y * (here.x - look_rows[0].dark);
}

// Twice the gradient of O (V - dark) in voxel space, by central differences over a voxel on each side: those of the
// voxels around, or where there was no memory for them, of what is interpolated.
vec3 slopes_at(vec3 at) {
    if (KEPT == 1u) return textureLod(gradients, image_place(p.grid, at), 0.0).xyz;
    return vec3(
        excess(at + vec3(1.0, 0.0, 0.0)) - excess(at - vec3(1.0, 0.0, 0.0)),
        excess(at + vec3(0.0, 1.0, 0.0)) - excess(at - vec3(0.0, 1.0, 0.0)),
        excess(at + vec3(0.0, 0.0, 1.0)) - excess(at - vec3(0.0, 0.0, 1.0)));
}

// A gradient in the scene, of twice that in voxel space.
vec3 gradient_in_scene(vec3 g) {
    return 0.5 * (g.x * p.voxel_from_scene[0].xyz + g.y * p.voxel_from_scene[1].xyz + g.z * p.voxel_from_scene[2].xyz);
}

// The magnitude of the gradient of O (V - dark), per mean edge of the CT's voxels, of twice that in voxel space.
float magnitude_of(vec3 slopes) {
    return p.edge * length(gradient_in_scene(slopes));
}

// The linear part of the affine from voxels to the scene.
mat3 scene_from_voxel() {
    return inverse(transpose(mat3(p.voxel_from_scene[0].xyz, p.voxel_from_scene[1].xyz, p.voxel_from_scene[2].xyz)));
}

// Opacity over `path` mm at a place, voxels and scene; nothing is there that is cut away.
float blocked_at(vec3 at, vec3 in_scene, float path) {
    uint function;
    vec2 here = medium_near(p.grid, at, function);
    for (uint i = 0u; i < look_rows[0].plane_count; ++i) {
        vec4 plane = look_rows[0].planes[i];
        if (dot(plane.xyz, in_scene) + plane.w < 0.0) here.y = 0.0;
    }
    return look_opacity(look_point(function, p.first + p.span * here.x).a, here.y, path);
}

// How much around a place of a surface is opaque, 0 to 1: volumetric ambient occlusion (Szirmay-Kalos et al. 2010).
// It follows from the mean opacity over the radius, at the corners of a tetrahedron in each, of two balls that touch
// the surface from outside, where O (V - dark) falls to. A plain or bulging surface leaves both empty. The radii are in
// shortest edges of a voxel, but along no axis less than that of the small ball in voxels: what is nearer is within the
// surface's own blur.
float occlusion_at(vec3 at, vec3 in_scene, vec3 gradient, mat3 scene_from_voxel) {
    vec3 per_mm = vec3(
        length(p.voxel_from_scene[0].xyz), length(p.voxel_from_scene[1].xyz), length(p.voxel_from_scene[2].xyz));
    float most = max(per_mm.x, max(per_mm.y, per_mm.z));
    float sum = 0.0;
    for (uint ball = 0u; ball < 2u; ++ball) {
        float radius = ball == 0u ? SMALL_BALL : LARGE_BALL;
        vec3 radii = max(radius / most * per_mm, SMALL_BALL);
        vec3 inward = radii * gradient;
        float steepness = dot(inward, inward);
        if (steepness <= 0.0) return 0.0;
        inward *= inversesqrt(steepness);
        // The second tetrahedron points the other way.
        float corner = ball == 0u ? BALL_CORNER : -BALL_CORNER;
        for (uint i = 0u; i < 4u; ++i) {
            vec3 signs = i == 0u ? vec3(1.0) : i == 1u ? vec3(1.0, -1.0, -1.0)
                : i == 2u ? vec3(-1.0, 1.0, -1.0) : vec3(-1.0, -1.0, 1.0);
            vec3 away = radii * (corner * signs - inward);
            sum += blocked_at(at + away, in_scene + scene_from_voxel * away, radius / most);
        }
    }
    return clamp((0.125 * sum - OPEN) / (CLOSED - OPEN), 0.0, 1.0);
}

// The mean of where a ray is absorbed in a homogeneous cell of this opacity, as a part of the cell: from half for a
// faint one to 0 for one that hides all behind its face.
float seen_part(float opacity) {
    return opacity < 0.01 ? 0.5 : -1.0 / log(1.0 - opacity) - (1.0 - opacity) / opacity;
}

vec3 to_voxel(vec4 x) {
    return vec3(dot(p.voxel_from_scene[0], x), dot(p.voxel_from_scene[1], x), dot(p.voxel_from_scene[2], x));
}

// A number from 0 to 1 for each pixel of each view (PCG of Jarzynski and Olano 2020).
float noise(uvec2 pixel, uint view) {
    uint h = (view * 8192u + pixel.y) * 65536u + pixel.x;
    h = h * 747796405u + 2891336453u;
    h = ((h >> ((h >> 28) + 4u)) ^ h) * 277803737u;
    h = (h >> 22) ^ h;
    return float(h >> 8) * (1.0 / 16777216.0);
}

// Marches the ray through a place of a view's picture, pixels from its upper left corner; together with those
// of the rest of the subgroup, whether they are wanted or not.
Gathered march(vec2 place, uint view, bool wanted) {
    View v = views[view];
    vec2 tangents = ray_tangents(v, place, p.size);
    vec3 toward = ray_direction(v, tangents);
    float len = length(vec3(tangents, 1.0));
    vec3 origin = to_voxel(vec4(v.eye, 1.0));
    vec3 direction = to_voxel(vec4(toward, 0.0));
    // No direction is quite parallel to a face, so that nothing is divided by 0.
    direction = mix(direction, vec3(1e-20), lessThan(abs(direction), vec3(1e-20)));
    vec3 inverse = 1.0 / direction;
    // One voxel beyond the outermost centres there is nothing.
    vec3 a = (-1.0 - origin) * inverse, b = (vec3(p.grid.texels) - origin) * inverse;
    vec3 enters = min(a, b), leaves = max(a, b);
    vec2 range = look_clipped(v.eye, toward, vec2(NEAREST, 3e38));
    range.x = max(range.x, max(enters.x, max(enters.y, enters.z)));
    range.y = min(range.y, min(leaves.x, min(leaves.y, leaves.z)));

    // Cell k goes from depth (k + shift) dz to (k + 1 + shift) dz.
    float dz = p.cell / len;
    float shift = 0.0;
    if (JITTER == 1u) shift = noise(uvec2(place), view);
    bool open = wanted && range.x < range.y;
    if (HIDDEN == 1u && open) {
        uvec2 patch_at = uvec2(place) * PATCHES / p.size;
        open = !all_hidden(view, patch_at, patch_at);
    }
    float entry = FAR, last = -1.0;
    if (open) {
        entry = floor(range.x / dz - shift);
        last = min(ceil(range.y / dz - shift) - 1.0, MOST);
    }
    float k = subgroupMin(entry);
    last = subgroupMax(last);
    float until = k; // in the cells before this one nobody leaves a brick
    bool shown = false; // whether the ray's own brick can be seen

    // Of a subgroup, where work is counted: rounds of the loops, the times that the field was sampled, and those that
    // the gradient was.
    uvec3 work = uvec3(0);
    vec3 colour = vec3(0.0);
    float clear = 1.0;
    float depth = 0.0;
    vec3 gradient = vec3(0.0);     // in eye space, as last found,
    float light = 1.0;             // with what ambient occlusion leaves of the light
    vec3 source = vec3(0.0);
    if (SHADED == 1u) source = look_source(v);
    mat3 from_voxel = mat3(0.0);
    if (OCCLUDED == 1u) from_voxel = scene_from_voxel();
    bool ends_known = p.parts > 1u || SEGMENTS == 1u; // cells of one part are sampled there alone
    float share_of_part = 1.0 / float(p.parts);
    vec2 start = vec2(0.0, -1.0); // V and O at the start of the cell; O < 0: not known
    float past = 0.0; // V at the start of the cell before
    while (k <= last && subgroupAny(open)) {
        if (COUNTING == 1u) work.x += 1u;
        float from = max((k + shift) * dz, range.x), to = min((k + 1.0 + shift) * dz, range.y);
        open = open && from < range.y;
        bool there = open && from < to;
        if (!there) from = to = NEAREST; // anything finite: it is not used
        bool leap = false;
        if (k >= until) {
            vec3 at = origin + 0.5 * (from + to) * direction;
            uvec3 brick = min(uvec3(max(at + 1.0, 0.0)) >> p.grid.shift, p.grid.bricks - 1u);
            int away = int(distances[brick_index(p.grid, brick)]);
            // The faces behind which this brick ends, or the cube of empty ones around it.
            int reach = max(away, 1);
            ivec3 low = ivec3(brick) - reach + 1, high = ivec3(brick) + reach;
            vec3 edge = vec3(uvec3(1) << p.grid.shift);
            vec3 wall = mix(vec3(low), vec3(high), greaterThan(direction, vec3(0.0))) * edge - 1.0;
            vec3 exits = (wall - origin) * inverse;
            float next = entry;
            if (there) next = floor(min(exits.x, min(exits.y, exits.z)) / dz - shift);
            if (!open) next = FAR;
            until = max(k + 1.0, subgroupMin(next));
            shown = there && away == 0;
            leap = !subgroupAny(shown);
        }
        // Not `continue`: with it a CPU driver masks all that follows.
        if (leap) {
            k = until;
            start.y = -1.0;
        } else {
            bool cut = there && shown;
            vec2 end = vec2(0.0, -1.0);
            if (ends_known) {
                // After a leap, or where the ray enters.
                bool begins = there && start.y < 0.0;
                if (subgroupAny(begins)) {
                    if (COUNTING == 1u) work.y += 2u;
                    vec2 found = field_at(origin + from * direction);
                    vec2 earlier = field_at(origin + max((k - 1.0 + shift) * dz, range.x) * direction);
                    if (begins) {
                        start = found;
                        past = earlier.x;
                    }
                }
                if (COUNTING == 1u) work.y += 1u;
                end = field_at(origin + to * direction);
                cut = cut && could_show(past, start, end);
            }
            uint rounds = subgroupAny(cut) ? p.parts : 0u;
            float part = (to - from) * share_of_part;
            vec2 before = start;
            for (uint i = 0u; i < rounds; ++i) {
                bool wanted = open && cut;
                float z = from + (float(i) + 0.5) * part;
                if (SEGMENTS == 1u) z = from + float(i + 1u) * part;
                vec3 at = origin + z * direction;
                vec2 here = end;
                bool sampled = i + 1u < p.parts; // the last one is told by the end of the cell
                if (SEGMENTS == 0u) sampled = true;
                if (sampled) {
                    if (COUNTING == 1u) work.y += 1u;
                    here = field_at(at);
                }
                // Opacity per mm, and of what is there: a function of an object has been asked for both together.
                vec4 got = vec4(0.0);
                float occupancy = here.y;
                float from_v = here.x;
                if (SEGMENTS == 1u) {
                    from_v = before.x;
                    occupancy = 0.5 * (before.y + here.y);
                    before = here;
                }
                if (OBJECTS != OWN_FUNCTIONS) {
                    if (SEGMENTS == 1u) got = look_segment(0u, from_v, here.x);
                    else got = look_point(0u, here.x);
                }
                // Whether something is there, but for the gradient.
                float there_is = got.a * occupancy;
                if (OBJECTS == OWN_FUNCTIONS) there_is = here.y;
                bool asks = wanted && there_is > 0.0;
                vec3 slopes = vec3(0.0);
                float magnitude = 0.0;
                if (GRADED == 1u) {
                    if (subgroupAny(asks)) {
                        if (COUNTING == 1u) work.z += 1u;
                        slopes = slopes_at(at);
                        magnitude = magnitude_of(slopes);
                        if (OBJECTS != OWN_FUNCTIONS) occupancy *= gradient_factor(0u, magnitude);
                    }
                }
                if (OBJECTS == OWN_FUNCTIONS) {
                    if (subgroupAny(asks)) got = objects_shown(at, vec2(from_v, here.x), magnitude, here.y);
                }
                float path = part * len;
                float opacity = OBJECTS == OWN_FUNCTIONS
                    ? 1.0 - exp(path * log(1.0 - got.a))
                    : look_opacity(got.a, occupancy, path);
                float share = wanted ? clear * opacity : 0.0;
                vec3 base = got.rgb;
                if (OBJECTS == TINTS) {
                    if (subgroupAny(share > 0.0)) base = tinted(base, tint_at(p.grid, at));
                }
                if (SHADED == 1u) {
                    bool anew = share > FAINT;
                    if (KEPT == 0u) {
                        bool even = p.parts > 1u ? (i & 1u) == 0u : mod(k, 2.0) == 0.0;
                        anew = share > STRONG || anew && even;
                    }
                    if (subgroupAny(anew)) {
                        if (GRADED == 0u) {
                            if (COUNTING == 1u) work.z += 1u;
                            slopes = slopes_at(at);
                        }
                        vec3 found = turned(v, gradient_in_scene(slopes));
                        if (anew) gradient = found;
                        if (OCCLUDED == 1u) {
                            // A long part is seen at its front. Its sample may lie behind the crest of a thin shell,
                            // where the field falls inwards: the outside of what hides all behind it is still the
                            // viewer's side.
                            float seen = from + (float(i) + seen_part(opacity)) * part;
                            bool behind_crest = opacity > HIDING && dot(found, vec3(tangents, 1.0)) < 0.0;
                            vec3 inward = behind_crest ? -slopes : slopes;
                            float occlusion =
                                occlusion_at(origin + seen * direction, v.eye + seen * toward, inward, from_voxel);
                            if (anew) light = 1.0 - look_rows[0].occlusion * occlusion;
                        }
                    }
                    base = look_lit(base, gradient, vec3(tangents, 1.0), source, light);
                }
                colour += share * base;
                depth += share * z;
                clear -= share;
                open = open && clear > p.dark;
            }
            past = start.x;
            start = there ? end : vec2(0.0, -1.0);
            k += 1.0;
        }
    }
    if (COUNTING == 1u) return Gathered(vec4(work, 1.0), depth);
    return Gathered(vec4(colour, 1.0 - clear), depth);
}

#endif
