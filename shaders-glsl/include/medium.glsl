// Where the V and O that a ray march samples come from, and how the objects in them are shown: a dense image
// of a volume, or an atlas of bricks. MEDIUM_BINDING is the first of their four places.
//
// An atlas has bricks of 8^3 voxels with an apron of one behind them, 9^3 texels: brick b has the voxels
// 8 b - 1 to 8 b + 7 along each axis, so whatever lies between two of them is interpolated within the brick. A
// table tells for each brick of the grid where it lies; all that hold nothing share the first place. Where there is no
// memory for all of them, a brick of level l stands for 2^l bricks along each axis, and has every 2^l-th voxel. Labels
// lie in an image of the same shape, or in a single texel where all have one. Beside each label the image says whether
// all that is in the cell from this voxel to the next ones has that label: within an object, and wherever it borders on
// nothing, a place has what eight voxels would tell it after one look.
//
// An image of the same shape may hold the gradient of O (V - dark) for each voxel (voxel_gradients.comp). Central
// differences of trilinear interpolation are the trilinear interpolation of central differences, so one look has what
// six would find.
#ifndef MEDIUM_GLSL
#define MEDIUM_GLSL
#extension GL_EXT_scalar_block_layout : require
#include "bricks.glsl"
#include "appearance.glsl"

layout(constant_id = 0) const uint MASKED = 0u;  // 1: the image holds an occupancy, too, as an atlas does; else all is there
layout(constant_id = 1) const uint ATLAS = 0u;   // ONE_LEVEL: the image is an atlas; LEVELS: of bricks of several levels
layout(constant_id = 2) const uint OBJECTS = 0u; // TINTS: objects have tints and opacities, or are hidden; OWN_FUNCTIONS:
                                                // or transfer functions of their own; of an atlas only
layout(binding = MEDIUM_BINDING) uniform sampler3D medium;
layout(scalar, binding = MEDIUM_BINDING + 1) readonly buffer Places { uint places[]; };
layout(binding = MEDIUM_BINDING + 2) uniform sampler3D labels;
layout(scalar, binding = MEDIUM_BINDING + 3) readonly buffer Appearances { Appearance appearances[]; };

const uint ONE_LEVEL = 1u;
const uint LEVELS = 2u;
const uint TINTS = 1u;
const uint OWN_FUNCTIONS = 2u;
// Texels of a brick along each axis.
const uint APRONED = 9u;
// Bits of a place of the atlas along each axis.
const uint PLACE_BITS = 10u;
const uint PLACE_MASK = (1u << PLACE_BITS) - 1u;
// Level of the coarsest bricks; a place has its level above those of the axes.
const uint MOST_LEVEL = 3u;

// A place of the grid as a place of the atlas, in texels from the centre of its first one.
vec3 atlas_place(BrickGrid g, vec3 at) {
    vec3 from_first = clamp(at + 1.0, vec3(0.0), vec3(g.texels) + 1.0);
    uvec3 bricks = (g.texels + 8u) >> 3;
    uvec3 brick = min(uvec3(from_first) >> 3, bricks - 1u);
    uint place = places[(brick.z * bricks.y + brick.y) * bricks.x + brick.x];
    uvec3 corner = uvec3(place, place >> PLACE_BITS, place >> (2u * PLACE_BITS)) & PLACE_MASK;
    uint level = 0u;
    if (ATLAS == LEVELS) level = place >> (3u * PLACE_BITS);
    vec3 inside = from_first - vec3((brick >> level << level) * 8u);
    if (ATLAS == LEVELS) inside *= 1.0 / float(1u << level);
    return vec3(corner * APRONED) + inside;
}

// A place of the grid in the image, as fractions of its edges.
vec3 image_place(BrickGrid g, vec3 at) {
    if (ATLAS == 0u) return (at + 0.5) / vec3(g.texels);
    return (atlas_place(g, at) + 0.5) / vec3(textureSize(medium, 0));
}

// V and O at a place of the grid, which is at `place` of the image; V as a fraction. Outside a dense image V is that of
// its face, and O is 0 from one voxel beyond.
vec2 medium_at(BrickGrid g, vec3 at, vec3 place) {
    vec2 found = textureLod(medium, place, 0.0).xy;
    if (MASKED == 0u) {
        vec3 inside = clamp(min(at + 1.0, vec3(g.texels) - at), 0.0, 1.0);
        found.y = inside.x * inside.y * inside.z;
    }
    return found;
}

// One of the eight voxels around a place of the atlas.
struct Voxel {
    Appearance object;
    float o; // its O, weighted trilinearly
};

// The label of a texel of the atlas, and 1 if its cell has no other, as fractions.
vec2 labels_at(ivec3 texel) {
    return texelFetch(labels, min(texel, textureSize(labels, 0) - 1), 0).xy;
}

// The object of a label.
Appearance object_called(float label) {
    return appearances[uint(label * 255.0 + 0.5)];
}

// What an object's opacity leaves of an O.
float shown_of(Appearance object, float o) {
    return object.visible == 0u ? 0.0 : o * object.opacity;
}

// The voxel at a corner, 0 to 7, of the cell from `low` on; `part` is how far the place is in the cell.
Voxel voxel_at(ivec3 low, vec3 part, uint corner) {
    ivec3 far = ivec3(corner & 1u, (corner >> 1) & 1u, corner >> 2);
    vec3 shares = mix(1.0 - part, part, equal(far, ivec3(1)));
    ivec3 texel = min(low + far, textureSize(medium, 0) - 1);
    float o = shares.x * shares.y * shares.z * texelFetch(medium, texel, 0).y;
    return Voxel(object_called(labels_at(texel).x), o);
}

// What the opacities of objects leave of O, here all of it `o`, at a place of the grid: the sum over the voxels around.
float shown_at(BrickGrid g, vec3 at, float o) {
    vec3 place = atlas_place(g, at);
    ivec3 low = ivec3(place);
    vec2 label = labels_at(low);
    bool alone = label.y > 0.5;
    float shown = shown_of(object_called(label.x), o);
    if (!alone) shown = 0.0;
    // A loop, since a CPU driver goes through both sides of an `if`.
    uint corners = alone ? 0u : 8u;
    for (uint corner = 0u; corner < corners; ++corner) {
        Voxel voxel = voxel_at(low, place - vec3(low), corner);
        shown += shown_of(voxel.object, voxel.o);
    }
    return shown;
}

// The mean tint of the objects at a place of the grid, weighted by O: as splats mix theirs by their weights.
vec4 tint_at(BrickGrid g, vec3 at) {
    vec3 place = atlas_place(g, at);
    ivec3 low = ivec3(place);
    vec2 label = labels_at(low);
    bool alone = label.y > 0.5;
    float whole = 0.0;
    vec4 tint = vec4(0.0);
    uint corners = alone ? 0u : 8u;
    for (uint corner = 0u; corner < corners; ++corner) {
        Voxel voxel = voxel_at(low, place - vec3(low), corner);
        whole += voxel.o;
        tint += voxel.o * voxel.object.tint;
    }
    return alone ? object_called(label.x).tint : whole > 0.0 ? tint / whole : vec4(0.0);
}

// V and what its object leaves of O at a place of the grid, and the transfer function there; of objects that of the
// nearest voxel counts.
vec2 medium_near(BrickGrid g, vec3 at, out uint function) {
    function = 0u;
    vec2 found = medium_at(g, at, image_place(g, at));
    if (OBJECTS == 0u) return found;
    Appearance object = object_called(labels_at(ivec3(atlas_place(g, at) + 0.5)).x);
    function = object.function;
    return vec2(found.x, shown_of(object, found.y));
}

// O (V - dark) of a voxel of the grid, V and `dark` as fractions, O as far as the opacity of its object leaves it.
float excess_of(BrickGrid g, ivec3 voxel, float dark) {
    ivec3 texel = voxel;
    if (ATLAS == 0u) texel = clamp(voxel, ivec3(0), ivec3(g.texels) - 1);
    vec3 place = vec3(texel);
    if (ATLAS != 0u) place = atlas_place(g, vec3(voxel));
    texel = ivec3(place);
    vec2 found = texelFetch(medium, texel, 0).xy;
    // Between the texels of a coarser brick.
    if (ATLAS == LEVELS && place != vec3(texel)) {
        found = textureLod(medium, (place + 0.5) / vec3(textureSize(medium, 0)), 0.0).xy;
        texel = ivec3(place + 0.5);
    }
    float o = found.y;
    if (MASKED == 0u) o = texel == voxel ? 1.0 : 0.0;
    if (OBJECTS != 0u) o = shown_of(object_called(labels_at(texel).x), o);
    return o * (found.x - dark);
}

#endif
