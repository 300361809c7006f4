#version 460
// Splats on a picture, the number of tiles that each is drawn in, and a key by which they are sorted from front to back.
// One invocation owns a splat.
#include "picture.glsl"
#include "picture_axes.glsl"
#include "harmonics.glsl"
layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform PictureProjectParams {
    View view;
    uvec2 size;
    uint splat_count;
    uint coefficients;
    float nearest; // depths of the least and the greatest key, mm
    float farthest;
    float widening; // pixels²
} p;
layout(scalar, binding = 0) readonly buffer Splats { Splat splats[]; };
layout(scalar, binding = 1) readonly buffer Harmonics { vec3 harmonics_of[]; }; // [splat][coefficient]
layout(scalar, binding = 2) writeonly buffer PictureSplats { PictureSplat picture_splats[]; };
layout(scalar, binding = 3) writeonly buffer TileCounts { uint tile_counts[]; };
layout(scalar, binding = 4) writeonly buffer Keys { uint keys[]; };
layout(scalar, binding = 5) writeonly buffer Values { uint values[]; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= p.splat_count) return;
    tile_counts[i] = 0;
    keys[i] = DEPTH_STEPS;
    values[i] = i;
    Splat s = splats[i];
    PictureAxes a = picture_axes(s, p.view, p.size);
    // What is counted here must be what picture_pairs.comp writes, which reads this from memory.
    precise PictureSplat r;
    r.opacity = 0.0;
    picture_splats[i] = r;
    if (!(a.mean.z > NEAREST)) return;
    vec3 covariance = picture_covariance(a, p.widening);
    float determinant = covariance.x * covariance.z - covariance.y * covariance.y;
    if (!(determinant > 0.0 && determinant < 1e37)) return;
    r.conic = vec3(covariance.z, -covariance.y, covariance.x) / determinant;
    r.centre = (a.tangents - p.view.tangents.xz) * a.focal;
    r.opacity = 1.0 / (1.0 + exp(-s.opacity_logit));
    r.depth = a.mean.z;
    float basis[16] = harmonics(normalize(s.mean - p.view.eye));
    r.colour = vec3(0.5);
    for (uint k = 0; k < p.coefficients; ++k) r.colour += basis[k] * harmonics_of[i * p.coefficients + k];
    r.colour = max(r.colour, 0.0);
    picture_splats[i] = r;
    keys[i] = uint(clamp((r.depth - p.nearest) / (p.farthest - p.nearest), 0.0, 1.0) * float(DEPTH_STEPS));
    uvec4 box = picture_tiles(r, p.size);
    uint count = 0;
    for (uint y = box.y; y < box.w; ++y)
        for (uint x = box.x; x < box.z; ++x)
            if (reaches_tile(r, uvec2(x, y))) count += 1;
    tile_counts[i] = count;
}
