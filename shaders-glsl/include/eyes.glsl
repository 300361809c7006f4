// What eyes.vert, eyes.frag and eyes_depth.frag share. With foveation an eye has two layers of what was
// rendered, two apart: the surround, all that it sees, and the inset, a part of that with more pixels, which
// fades into it.
#extension GL_EXT_multiview : require
#extension GL_EXT_scalar_block_layout : require
layout(constant_id = 0) const uint LINEAR = 0u;   // 1: the target turns light into sRGB by itself
layout(constant_id = 1) const uint FOVEATED = 0u; // 1: with insets
layout(push_constant, scalar) uniform EyesParams {
    vec2 part;       // of the picture's edges that were rendered
    vec2 most;       // texture coordinates beyond which a sample would take in what was not
    vec4 background; // display-referred, premultiplied
    vec2 range;      // distances along the viewing direction of depths 0 and 1, mm
    vec4 insets[2];  // left, upper, right and lower edge, as parts of the eye's picture
    float fading;    // part of an inset's edges over which it fades
    vec4 marks[2];   // middle and half-axes of the mark of a draft, as parts of the eye's picture; 0: there is none
} p;

// Texture coordinates of a place of a picture, 0 to 1 from the upper left corner.
vec2 texture_place(vec2 place) {
    return min(place * p.part, p.most);
}

// The same in an inset for a place of the eye's picture.
vec2 inset_place(vec2 place, vec4 inset) {
    return texture_place((place - inset.xy) / (inset.zw - inset.xy));
}

// The inset's share of what is seen at a place: smoothly from 0 at its edges to 1, except at the edges of the
// picture, where there is nothing to fade into.
float inset_share(vec2 place, vec4 inset) {
    vec2 reach = p.fading * (inset.zw - inset.xy);
    vec2 low = mix((place - inset.xy) / reach, vec2(1.0), lessThanEqual(inset.xy, vec2(0.0)));
    vec2 high = mix((inset.zw - place) / reach, vec2(1.0), greaterThanEqual(inset.zw, vec2(1.0)));
    return smoothstep(0.0, 1.0, min(min(low.x, low.y), min(high.x, high.y)));
}

// The word beside the mark of a draft, a bit a texel: a row of it from the left, the highest first.
const uint WORD_WIDTH = 29;
const uint WORD_HEIGHT = 7;
const uint WORD[7] =
    uint[7](0x1E78E7DFu, 0x11451404u, 0x11451404u, 0x1179F784u, 0x11511404u, 0x11491404u, 0x1E451404u);
// Edge of a texel of the word, and where the word begins, in radii of the mark from its middle.
const float WORD_TEXEL = 0.3;
const float WORD_START = 2.0;

// True where the word covers a place, in radii from the middle of the mark; `plate` tells whether the dark
// plate behind it does.
bool word_covers(vec2 from_middle, out bool plate) {
    vec2 size = vec2(WORD_WIDTH, WORD_HEIGHT);
    vec2 at = (from_middle - vec2(WORD_START, 0.0)) / WORD_TEXEL + vec2(0.0, 0.5 * size.y);
    plate = all(greaterThan(at, vec2(-2.0))) && all(lessThan(at, size + 2.0));
    if (any(lessThan(at, vec2(0.0))) || any(greaterThanEqual(at, size))) return false;
    return (WORD[uint(at.y)] >> (WORD_WIDTH - 1u - uint(at.x)) & 1u) == 1u;
}

// The mark of a draft over what is seen at a place: a disc of amber with a dark rim, so that it is seen
// before anything, and the word beside it.
vec4 marked(vec2 place, vec4 colour) {
    vec4 mark = p.marks[gl_ViewIndex];
    if (mark.z <= 0.0) return colour;
    const vec4 AMBER = vec4(1.0, 0.75, 0.1, 1.0), DARK = vec4(0.1, 0.1, 0.1, 1.0);
    vec2 from_middle = (place - mark.xy) / mark.zw;
    float radius = length(from_middle);
    if (radius < 1.0) return radius < 0.7 ? AMBER : DARK;
    bool plate;
    if (word_covers(from_middle, plate)) return AMBER;
    return plate ? DARK : colour;
}
