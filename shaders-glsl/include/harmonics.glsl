// Colours of standard splats: real spherical harmonics up to degree 3 (engine/splat/src/harmonics.rs), their
// coefficients in halves.
#ifndef HARMONICS_GLSL
#define HARMONICS_GLSL

// Y_k at a unit vector, for k up to 15.
float[16] harmonics(vec3 d) {
    float x = d.x, y = d.y, z = d.z;
    float xx = x * x, yy = y * y, zz = z * z;
    return float[16](
        0.28209479,
        -0.48860251 * y,
        0.48860251 * z,
        -0.48860251 * x,
        1.09254843 * x * y,
        -1.09254843 * y * z,
        0.31539157 * (2.0 * zz - xx - yy),
        -1.09254843 * x * z,
        0.54627422 * (xx - yy),
        -0.59004359 * y * (3.0 * xx - yy),
        2.89061144 * x * y * z,
        -0.45704580 * y * (4.0 * zz - xx - yy),
        0.37317633 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.45704580 * x * (4.0 * zz - xx - yy),
        1.44530572 * z * (xx - yy),
        -0.59004359 * x * (xx - 3.0 * yy));
}

#endif
