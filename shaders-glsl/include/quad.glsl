// A splat as mode alpha draws it for one view: an ellipse on the picture, the optical depth through its
// middle, and one colour.
//
// Drawn is the extinction e (1 - q/6)^(3/2). At the depth m of its centre, and to first order in the size
// of a splat over m, q = A l² + γ along a ray, with l in mm of the ray and γ = m² |across (t - c)|² for
// tangents t of the ray and c of the centre (projected.glsl). So the optical depth is K (1 - γ/6)² with
// K = e √(6/A) 3π/8. A standard splat (3D Gaussian splatting) has the opacity K exp(-γ/2), and a footprint
// widened by 0.3 pixels².
#ifndef QUAD_GLSL
#define QUAD_GLSL
#extension GL_EXT_scalar_block_layout : require

// Ellipses end where the opacity falls below this; so do those of most viewers.
const float LEAST_OPACITY = 1.0 / 255.0;
const float LEAST_DEPTH = 0.0039292; // the optical depth of that: -ln(1 - 1/255)
// Opacity of standard splats is cut here, as their inventors do.
const float MOST_OPACITY = 0.99;

// See types.rs.
struct Quad {
    vec2 centre;
    vec3 axes;
    float edge;
    float thickness;
    float depth;
    vec3 colour;
};

// See types.rs.
struct Centre {
    vec3 slope;
    vec3 occupancy_slope;
};

#endif
