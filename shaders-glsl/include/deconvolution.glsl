// What the two kernels of a deconvolution share: the lists that tell which splats are drawn at which points.
//
// A splat draws its extinction, and its extinction times its colour, with the profile (1 - q/6)^(3/2). Their sum
// is to be the medium that the transfer function makes of the field. Richardson and Lucy's iteration (1972,
// 1974) finds the extinctions and colours: at points in the splats, the wanted is divided by the drawn; each
// splat is multiplied by the mean of these ratios over what it draws, each point standing for a volume.
#ifndef DECONVOLUTION_GLSL
#define DECONVOLUTION_GLSL
#extension GL_EXT_scalar_block_layout : require

// Rounds after the first. Each but the last one goes twice as far as Richardson and Lucy do.
const uint ROUNDS = 3;

layout(push_constant, scalar) uniform DeconvolutionParams {
    uint count;
    uint round;
} p;

// A pair has the index of the other in its upper 24 bits and a weight, 1 to 255, in the lower 8: of a point's
// list that of the profile in steps of 1/255, of a splat's list that of the point in the splat's mean.
float pair_weight(uint pair) {
    return float(pair & 255u);
}

// What pairs lead to is kept in halves: reading it is nearly all of the work.
uvec2 in_halves(vec4 v) {
    return uvec2(packHalf2x16(v.xy), packHalf2x16(v.zw));
}

vec4 from_halves(uvec2 v) {
    return vec4(unpackHalf2x16(v.x), unpackHalf2x16(v.y));
}

#endif
