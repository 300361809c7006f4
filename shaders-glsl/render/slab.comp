#version 460
// Slabs: along every ray, Σw and Σwc at eight planes at a time, then V = b + Σwc / (Σw + ε) and O = Σw / (Σw
// + w0), and only then the transfer function; front to back, until no light is left (after the sheet buffers
// of Mueller and Crawfis 1998, classified after reconstruction). Nothing is sorted within a block of planes:
// sums have no order.
//
// A tile has eight parts of 4 x 8 pixels. With GROUP = 64 a workgroup is two parts side by side, and an
// invocation owns a pixel, since the sums of four would not fit a GPU's registers. With GROUP = 8 a workgroup is
// one part, and an invocation owns four pixels: then all loads of splats are uniform, which a CPU driver turns
// into scalar ones, and one load serves four. The result has the same bits.
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_shader_image_load_formatted : require
#include "appearance.glsl"
#include "kernel.glsl"
#include "look.glsl"
#include "tiles.glsl"
layout(local_size_x_id = 1) in;
layout(constant_id = 1) const uint GROUP = 64;
layout(constant_id = 2) const uint SEGMENTS = 0; // 1: the transfer function is integrated between planes
layout(constant_id = 3) const uint SHADED = 0;   // 1: with the gradient's light
layout(constant_id = 4) const uint DEPTH = 0;    // 1: depth is written
layout(constant_id = 5) const uint OBJECTS = 0;  // 1: objects have tints and opacities
layout(constant_id = 6) const uint HIDDEN = 0;   // 1: parts of tiles that no eye sees stay transparent
layout(constant_id = 7) const uint COUNTING = 0; // 1: the picture shows work instead of colours, see below
layout(push_constant, scalar) uniform SlabParams {
    TileGrid grid;
    float background;
    float epsilon;
    float occupancy_w0;
    float dark;
    uint first_row;
} p;
layout(scalar, binding = 4) readonly buffer Starts { uint starts[]; };
layout(scalar, binding = 5) readonly buffer Pairs { uint pairs[]; };
layout(scalar, binding = 6) readonly buffer ProjectedRows { Projected projected[]; };
layout(binding = 7) writeonly uniform image2DArray colour_image;
layout(binding = 8) writeonly uniform image2DArray depth_image;
layout(scalar, binding = 9) readonly buffer ActiveObjects { uint active_objects[]; };
layout(scalar, binding = 10) readonly buffer Appearances { Appearance appearances[]; };
layout(scalar, binding = 11) readonly buffer HiddenParts { uint hidden_parts[]; };

// Pixels of an invocation, at most and in this shape; invocations of a part, and parts of a workgroup.
const uint MOST_PIXELS = 4;
const uint PIXELS = 1 + 24 / GROUP; // 4 or 1
const uint LANES = 32 / PIXELS;
const uint SIDE_BY_SIDE = GROUP / LANES;
// The bound of the loop is no specialisation constant, so that it is unrolled when the shader is built.
#define FOR_PIXELS [[unroll]] for (uint n = 0; n < MOST_PIXELS; ++n) if (n < PIXELS)

// Σw, Σwc and, where there is light, their gradients in eye space; Σw times tint and opacity of the splats'
// objects.
float weight[PLANES * MOST_PIXELS];
float value[PLANES * MOST_PIXELS];
vec3 weight_slope[PLANES * MOST_PIXELS];
vec3 value_slope[PLANES * MOST_PIXELS];
vec4 tint[PLANES * MOST_PIXELS];
float shown[PLANES * MOST_PIXELS];

void add(Projected s, Appearance object, vec2 ray[MOST_PIXELS], float depths[PLANES], uint from) {
    float a[4];
    float zz[4];
    [[unroll]] for (uint k = 0; k < 4; ++k) {
        float z = depths[from + k];
        a[k] = s.along.x * ((z - s.depth) / z);
        zz[k] = z * z;
    }
    FOR_PIXELS {
        vec2 d = ray[n] - s.centre;
        float lean = s.along.y * d.x + s.along.z * d.y;
        float u = s.across.x * d.x + s.across.y * d.y;
        float v = s.across.z * d.y;
        float aside = u * u + v * v;
        [[unroll]] for (uint k = 0; k < 4; ++k) {
            uint at = (from + k) * MOST_PIXELS + n;
            float t = a[k] + lean;
            float q = zz[k] * (t * t + aside);
            float w;
            if (SHADED == 1) {
                vec2 kernel = kernel_value_slope(q) * s.amplitude;
                w = kernel.x;
                vec3 h = vec3(
                    s.along.y * t + s.across.x * u,
                    s.along.z * t + s.across.y * u + s.across.z * v,
                    s.along.x * t);
                h.z -= dot(s.centre, h.xy);
                h *= -kernel.y * depths[from + k];
                weight_slope[at] += h;
                value_slope[at] += h * s.intensity;
            } else {
                w = s.amplitude * kernel_value(q);
            }
            weight[at] += w;
            value[at] += w * s.intensity;
            if (OBJECTS == 1) {
                tint[at] += w * object.tint;
                shown[at] += w * object.opacity;
            }
        }
    }
}

void main() {
    const uint groups = PARTS / SIDE_BY_SIDE; // workgroups of a tile
    uint lane = gl_LocalInvocationIndex % LANES;
    uint first_part = gl_WorkGroupID.x % groups * SIDE_BY_SIDE;
    uint part = first_part + gl_LocalInvocationIndex / LANES;
    uvec2 tile = uvec2(gl_WorkGroupID.x / groups, p.first_row + gl_WorkGroupID.y);
    View v = views[gl_WorkGroupID.z];
    uvec2 pixel = tile * TILE + uvec2((part & 3u) * 4, (part >> 2) * 8) + uvec2(lane & 3u, lane >> 2);
    uint list_tile = (gl_WorkGroupID.z * p.grid.tiles.y + tile.y) * p.grid.tiles.x + tile.x;
    if (HIDDEN == 1 && (hidden_parts[list_tile] >> part & 1u) == 1) {
        FOR_PIXELS {
            uvec2 to = pixel + uvec2(0, 2 * n);
            if (any(greaterThanEqual(to, p.grid.size))) continue;
            imageStore(colour_image, ivec3(to, gl_WorkGroupID.z), vec4(0.0));
            if (DEPTH == 1) imageStore(depth_image, ivec3(to, gl_WorkGroupID.z), vec4(0.0));
        }
        return;
    }
    uint first_list = list_tile * p.grid.blocks;
    uint row = gl_WorkGroupID.z * p.grid.splat_count;

    vec2 ray[MOST_PIXELS];
    float path[MOST_PIXELS]; // mm of ray per plane
    vec2 range[MOST_PIXELS]; // depths that the clip planes leave
    vec3 colour[MOST_PIXELS];
    float clear[MOST_PIXELS];
    float depth[MOST_PIXELS];
    vec2 before[MOST_PIXELS]; // V and O at the plane before
    FOR_PIXELS {
        ray[n] = ray_tangents(v, vec2(pixel + uvec2(0, 2 * n)) + 0.5, p.grid.size);
        path[n] = p.grid.spacing * length(vec3(ray[n], 1.0));
        range[n] = look_clipped(v.eye, ray_direction(v, ray[n]), vec2(0.0, 3e38));
        colour[n] = vec3(0.0);
        clear[n] = 1.0;
        depth[n] = 0.0;
        before[n] = vec2(0.0);
    }

    // Of a part, where work is counted: planes at which splats of the part were evaluated, at which those of
    // the whole tile would have been, planes classified, and pairs looked at.
    uvec4 work = uvec4(0);
    vec3 source = vec3(0.0); // towards the key light, in eye space
    if (SHADED == 1) source = look_source(v);
    float first = first_depth(p.grid, v);
    uint rounds = p.grid.planes / PLANES;
    for (uint block = 0; block < p.grid.blocks; ++block) {
        uint start = min(starts[first_list + block], p.grid.capacity);
        uint end = min(starts[first_list + block + 1], p.grid.capacity);
        if (start == end) {
            FOR_PIXELS before[n] = vec2(0.0);
            continue;
        }
        for (uint round = 0; round < rounds; ++round) {
            float depths[PLANES];
            [[unroll]] for (uint k = 0; k < PLANES; ++k) {
                depths[k] = first + (float((block * rounds + round) * PLANES + k) + 0.5) * p.grid.spacing;
            }
            [[unroll]] for (uint i = 0; i < PLANES * MOST_PIXELS; ++i) {
                weight[i] = 0.0;
                value[i] = 0.0;
                if (SHADED == 1) {
                    weight_slope[i] = vec3(0.0);
                    value_slope[i] = vec3(0.0);
                }
                if (OBJECTS == 1) {
                    tint[i] = vec4(0.0);
                    shown[i] = 0.0;
                }
            }
            for (uint i = start; i < end; ++i) {
                uint pair = pairs[i];
                if (COUNTING == 1) {
                    Projected c = projected[pair & ((1u << ROW_BITS) - 1u)];
                    float lowest = c.depth - c.reach, highest = c.depth + c.reach;
                    uint planes = highest >= depths[0] && lowest <= depths[3] ? 4 : 0;
                    if (highest >= depths[4] && lowest <= depths[7]) planes += 4;
                    bool beside = (pair >> (ROW_BITS + (part & ~1u)) & 3u) != 0;
                    work += uvec4((pair >> (ROW_BITS + part) & 1u) * planes, beside ? planes : 0, 0, 1);
                }
                if ((pair >> (ROW_BITS + part) & 1u) == 0) continue;
                Projected s = projected[pair & ((1u << ROW_BITS) - 1u)];
                Appearance object = Appearance(vec4(0.0), 1.0, 1, 0);
                if (OBJECTS == 1) object = appearances[active_objects[(pair & ((1u << ROW_BITS) - 1u)) - row]];
                float near = s.depth - s.reach, far = s.depth + s.reach;
                if (far >= depths[0] && near <= depths[3]) add(s, object, ray, depths, 0);
                if (far >= depths[4] && near <= depths[7]) add(s, object, ray, depths, 4);
            }
            [[unroll]] for (uint k = 0; k < PLANES; ++k) {
                float z = depths[k];
                bool any_there = false;
                FOR_PIXELS {
                    any_there = any_there || (weight[k * MOST_PIXELS + n] > 0.0 && clear[n] > p.dark);
                }
                if (!subgroupAny(any_there)) {
                    FOR_PIXELS before[n] = vec2(0.0);
                    continue;
                }
                if (COUNTING == 1) work.z += 1;
                FOR_PIXELS {
                    uint at = k * MOST_PIXELS + n;
                    float w = weight[at];
                    bool there = w > 0.0 && clear[n] > p.dark && z >= range[n].x && z <= range[n].y;
                    float inverse = 1.0 / (w + p.epsilon);
                    float relative = value[at] * inverse;
                    vec2 here = vec2(p.background + relative, w / (w + p.occupancy_w0));
                    float full = here.y; // O before the objects' opacity
                    vec4 own = vec4(0.0);
                    if (OBJECTS == 1) {
                        float part = 1.0 / max(w, 1e-30);
                        own = tint[at] * part;
                        here.y *= shown[at] * part;
                    }
                    vec4 got;
                    float occupancy = here.y;
                    if (SEGMENTS == 1) {
                        got = look_segment(0u, before[n].y > 0.0 ? before[n].x : here.x, here.x);
                        occupancy = 0.5 * (before[n].y + here.y);
                    } else {
                        got = look_point(0u, here.x);
                    }
                    before[n] = there ? here : vec2(0.0);
                    float opacity = look_opacity(got.a, occupancy, path[n]);
                    if (!there) opacity = 0.0;
                    vec3 base = got.rgb;
                    if (OBJECTS == 1) base = tinted(base, own);
                    if (SHADED == 1) {
                        vec3 slope = (value_slope[at] - relative * weight_slope[at]) * inverse;
                        float fall = p.occupancy_w0 / ((w + p.occupancy_w0) * (w + p.occupancy_w0));
                        vec3 gradient = full * slope + (here.x - look_rows[0].dark) * fall * weight_slope[at];
                        base = look_lit(base, gradient, vec3(ray[n], 1.0), source, 1.0);
                    }
                    float share = clear[n] * opacity;
                    colour[n] += share * base;
                    depth[n] += share * z;
                    clear[n] -= share;
                }
            }
        }
        bool open = false;
        FOR_PIXELS open = open || clear[n] > p.dark;
        if (!subgroupAny(open)) break;
    }
    FOR_PIXELS {
        uvec2 to = pixel + uvec2(0, 2 * n);
        if (any(greaterThanEqual(to, p.grid.size))) continue;
        ivec3 at = ivec3(to, gl_WorkGroupID.z);
        if (COUNTING == 1) imageStore(colour_image, at, vec4(work));
        else imageStore(colour_image, at, vec4(colour[n], 1.0 - clear[n]));
        if (DEPTH == 1) imageStore(depth_image, at, vec4(depth[n]));
    }
}
