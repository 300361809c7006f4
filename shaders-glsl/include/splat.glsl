// The structs that kernels share with each other and with the host (src/types.rs mirrors them, build.rs checks).
#ifndef SPLAT_GLSL
#define SPLAT_GLSL
#extension GL_EXT_scalar_block_layout : require

// Raw parameters of one splat; see types.rs.
struct Splat {
    vec3 mean;
    float opacity_logit;
    vec4 rotation; // w, x, y, z
    vec3 log_scale;
    float intensity;
};

// What rasterising needs of a splat: d = x - mean, u = column_x*d.x + column_y*d.y + column_z*d.z is the whitened
// distance, q = |u|^2 (the squared Mahalanobis distance). Whitened, not through the covariance: at an anisotropy
// of 1000 the covariance form has lost every digit, this one three of seven.
struct Footprint {
    vec3 mean;
    float opacity;
    float intensity;
    vec3 column_x;
    vec3 column_y;
    vec3 column_z;
    vec3 extent; // half size of the box that holds the support, voxels
};

// dL/d(parameter) of one splat; rotation as a small rotation vector in the splat's own axes.
struct SplatGrad {
    vec3 mean;
    float opacity_logit;
    vec3 rotation;
    vec3 log_scale;
    float intensity;
};

// Where the samples of a pass lie: sample (x, y, z) of the brick grid is at voxel (x, y, z) + offset.
struct Grid {
    uvec3 bricks;   // bricks along x, y, z
    uint first_slot; // the slots of this chunk are first_slot .. first_slot + slot_count
    vec3 offset;    // of the samples from the voxel centres, voxels
    uint slot_count;
};

// Σw and the reconstructed value V^ (relative to the background) of one sample.
struct Reconstruction {
    float weight;
    float value;
};

// What a sample should be. occupancy < 0 marks a sample that takes no part.
struct Target {
    float value;
    float occupancy;
};

// dL/dV^ and dL/dW of one sample.
struct Adjoint {
    float value;
    float weight;
};

const uint NO_SLOT = 0xFFFFFFFFu;

#endif
