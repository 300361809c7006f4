// The structs that kernels share with each other and with the host (src/types.rs mirrors them, build.rs
// checks).
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

// What rasterizing needs of a splat. With d = x - mean the whitened distance is u = T d, T upper triangular:
//   u.x = t_x . d,  u.y = t_y.x d.y + t_y.y d.z,  u.z = t_z d.z,   q = |u|^2 (the squared Mahalanobis distance).
// T is the R of a QR decomposition of S^-1 R^T, so q is the same and six products do. Whitened, not through
// the covariance: at an anisotropy of 1000 the covariance form has lost every digit, this one three of seven.
struct Footprint {
    vec3 mean;
    float amplitude; // a: w = a κ(q)
    vec3 t_x;
    float intensity;
    vec2 t_y;
    float t_z;
    vec3 extent; // half size of the box that holds the support, voxels
};

// Floats of a row of moments: S0, C0, S1 (3), the symmetric S2 (6); see splat_to_volume_grad.comp.
const uint MOMENTS = 11;

// dL/d(parameter) of one splat; rotation as a small rotation vector in the splat's own axes.
struct SplatGrad {
    vec3 mean;
    float opacity_logit;
    vec3 rotation;
    vec3 log_scale;
    float intensity;
};

// What a fit keeps of a splat besides Adam's moments.
struct History {
    float gradient_norm; // Σ |dL/dμ| since the host cleared it
    float log_scale_cap; // no log scale exceeds this
};

// Where the samples of a pass lie: sample (x, y, z) of the brick grid is at voxel (x, y, z) + offset.
struct Grid {
    uvec3 bricks;   // bricks along x, y, z
    uint first_slot; // the slots of this chunk are first_slot .. first_slot + slot_count
    vec3 offset;    // of the samples from the voxel centres, voxels
    uint slot_count;
};

// Σw and the reconstructed value V^ (relative to the background) of one sample. Stored as storage.glsl says.
struct Reconstruction {
    float weight;
    float value;
};

// What a sample should be, relative to the background in spans of the intensity range, so within -1 .. 1.
// occupancy < 0 marks a sample that takes no part. Stored as two 16-bit fractions: a step of 0.12 HU over
// 4095.
struct Target {
    float value;
    float occupancy;
};

Target unpack_target(uint stored) {
    vec2 t = unpackSnorm2x16(stored);
    return Target(t.x, t.y);
}

// dL/dV^ and dL/dW of one sample. Stored as storage.glsl says.
struct Adjoint {
    float value;
    float weight;
};

// Rotation matrix of a unit quaternion (w, x, y, z); its columns are the axes of the ellipsoid.
mat3 rotation_matrix(vec4 r) {
    return mat3(
        1.0 - 2.0 * (r.z * r.z + r.w * r.w), 2.0 * (r.y * r.z + r.x * r.w), 2.0 * (r.y * r.w - r.x * r.z),
        2.0 * (r.y * r.z - r.x * r.w), 1.0 - 2.0 * (r.y * r.y + r.w * r.w), 2.0 * (r.z * r.w + r.x * r.y),
        2.0 * (r.y * r.w + r.x * r.z), 2.0 * (r.z * r.w - r.x * r.y), 1.0 - 2.0 * (r.y * r.y + r.z * r.z));
}

// S^-1 R^T D^-1: d, voxels -> whitened distance along the splat's own axes. D is the diagonal `stretch`: voxels along each
// axis to a unit of the space in which splats have their shape.
mat3 whitening(Splat s, vec3 stretch) {
    mat3 t = transpose(rotation_matrix(s.rotation));
    vec3 inverse = exp(-s.log_scale);
    return mat3(t[0] * inverse / stretch.x, t[1] * inverse / stretch.y, t[2] * inverse / stretch.z);
}

const uint NO_SLOT = 0xFFFFFFFFu;

#endif
