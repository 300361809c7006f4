// Rods: round bodies between two places, with a half sphere at each end. Each is drawn as bands of triangles
// from one end to the other.
#extension GL_EXT_scalar_block_layout : require

// Triangles around a rod, and bands along it: two for each half sphere, one between them.
const uint SIDES = 12;
const uint BANDS = 5;
// Corners of a rod's triangles: 6 for each side of each band.
const uint CORNERS = 360;

// See types.rs.
struct Rod {
    vec3 from;
    vec3 to;
    vec2 radii;
    uint colour;
};
