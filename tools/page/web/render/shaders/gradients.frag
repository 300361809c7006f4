// The gradients of one layer of the atlas, as shaders-glsl/render/voxel_gradients.comp makes them.
uniform BrickGrid grid;
uniform highp usampler2D brick_at_image; // coordinates of the brick at each place of the atlas, ten bits an axis
uniform int layer;
uniform float dark, unit;
out vec4 slopes;

void main() {
    ivec3 texel = ivec3(gl_FragCoord.xy, layer), edge = ivec3(APRONED);
    ivec3 place = texel / edge, across = textureSize(medium, 0) / edge;
    uint brick = texelFetch(brick_at_image, texel_of(uint((place.z * across.y + place.y) * across.x + place.x)), 0).x;
    if (brick == ~0u) {
        slopes = vec4(0.0);
        return;
    }
    ivec3 first = ivec3(brick & PLACE_MASK, (brick >> PLACE_BITS) & PLACE_MASK, brick >> (2u * PLACE_BITS)) * 8 - 1;
    ivec3 voxel = first + texel - place * edge;
    ivec3 x = ivec3(1, 0, 0), y = ivec3(0, 1, 0), z = ivec3(0, 0, 1);
    slopes = unit * vec4(
        excess_of(grid, voxel + x, dark) - excess_of(grid, voxel - x, dark),
        excess_of(grid, voxel + y, dark) - excess_of(grid, voxel - y, dark),
        excess_of(grid, voxel + z, dark) - excess_of(grid, voxel - z, dark), 0.0);
}
