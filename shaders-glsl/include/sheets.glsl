// Planes in the room on which triangles of egui lie.
#extension GL_EXT_scalar_block_layout : require

// See types.rs.
struct Sheet {
    vec4 clip;
    vec3 zero;
    vec3 right;
    vec3 down;
};
