// Faces around what a look can show of a volume. A cube of bricks is shown if one of them can be seen
// (occupancy_mark.comp); a face of it is listed if no shown cube lies behind it. Face 2 a + s of cube c, at the
// lower (s = 0) or upper (s = 1) end of axis a, is listed as 6 c + 2 a + s. Cubes count as bricks do, x fastest.
#ifndef FACES_GLSL
#define FACES_GLSL
#include "bricks.glsl"

// Edge of a cube, bricks. Smaller ones fit closer, and have more faces.
const uint CUBE = 4;

uvec3 cube_count(BrickGrid g) {
    return (g.bricks + (CUBE - 1u)) / CUBE;
}

#endif
