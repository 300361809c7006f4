#version 460
// Corners of the listed faces (faces.glsl), two triangles each: of those by which rays leave, so that an eye may
// be among the cubes; others have no area. All have one depth, which marks the pixels that they cover.
//
// The faces lie outwards by more than rounding moves rays and corners. So what can be seen lies inside of them,
// and a ray that meets any of it leaves through one of them.
#extension GL_EXT_multiview : require
#include "view.glsl"
#include "faces.glsl"
layout(push_constant, scalar) uniform MarkParams {
    BrickGrid grid;
    vec4 voxel_from_scene[3];
    uvec2 size;
} p;
layout(scalar, binding = 0) readonly buffer Views { View views[]; };
layout(scalar, binding = 1) readonly buffer Faces { uint faces[]; };

const float MARGIN = 0.25;        // voxels
const float SNAPPED = 1.0 / 8.0;  // pixels, since corners are rounded to 1/16 of one at the coarsest
const vec2 SQUARE[6] = vec2[](vec2(0, 0), vec2(1, 0), vec2(0, 1), vec2(0, 1), vec2(1, 0), vec2(1, 1));

void main() {
    View v = views[gl_ViewIndex];
    uint face = faces[uint(gl_VertexIndex) / 6u];
    uint cube = face / 6u, axis = face % 6u >> 1;
    bool upper = (face & 1u) == 1u;
    vec3 texels = vec3(p.grid.texels);
    // From here on places count in voxels from the eye.
    mat3 rows = mat3(p.voxel_from_scene[0].xyz, p.voxel_from_scene[1].xyz, p.voxel_from_scene[2].xyz);
    mat3 scene_from_voxel = transpose(inverse(rows));
    vec3 eye = v.eye * rows + vec3(p.voxel_from_scene[0].w, p.voxel_from_scene[1].w, p.voxel_from_scene[2].w);
    // A pixel where the volume is farthest, mm.
    vec3 edges = texels * vec3(length(scene_from_voxel[0]), length(scene_from_voxel[1]), length(scene_from_voxel[2]));
    float far = length(scene_from_voxel * (0.5 * texels - eye)) + 0.5 * (edges.x + edges.y + edges.z);
    vec2 tangents = vec2(v.tangents.y - v.tangents.x, v.tangents.z - v.tangents.w) / vec2(p.size);
    float pixel = far * max(tangents.x, tangents.y);
    vec3 margin = MARGIN + SNAPPED * pixel * vec3(length(rows[0]), length(rows[1]), length(rows[2]));

    uvec3 cubes = cube_count(p.grid);
    vec3 extent = vec3(uvec3(CUBE) << p.grid.shift);
    vec3 low = vec3(cube % cubes.x, cube / cubes.x % cubes.y, cube / (cubes.x * cubes.y)) * extent - 1.0;
    vec3 high = min(low + extent, texels) + margin - eye;
    low -= margin + eye;
    if (upper ? high[axis] <= 0.0 : low[axis] >= 0.0) {
        gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
        return;
    }
    vec2 square = SQUARE[uint(gl_VertexIndex) % 6u];
    vec3 part;
    part[axis] = upper ? 1.0 : 0.0;
    part[(axis + 1u) % 3u] = square.x;
    part[(axis + 2u) % 3u] = square.y;
    vec3 at = turned(v, scene_from_voxel * mix(low, high, part));
    vec2 place = (2.0 * at.xy - (v.tangents.xz + v.tangents.yw) * at.z) / (v.tangents.yw - v.tangents.xz);
    gl_Position = vec4(place, 0.5 * at.z, at.z);
}
