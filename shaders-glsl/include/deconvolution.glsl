// What the two kernels of a deconvolution share: the lists that tell which splats are drawn at which points.
//
// A splat draws its extinction, and its extinction times its colour, with the profile (1 - q/6)^(3/2). Their sum
// is to be the medium that the transfer function makes of the field. Richardson and Lucy's iteration (1972,
// 1974) finds the extinctions and colours: at points in the splats, the wanted is divided by the drawn; each
// splat is multiplied by the mean of these ratios over what it draws, each point standing for a volume.
#ifndef DECONVOLUTION_GLSL
#define DECONVOLUTION_GLSL
#extension GL_EXT_scalar_block_layout : require

layout(push_constant, scalar) uniform DeconvolutionParams {
    uint count;
    uint round;
} p;

// A pair has the index of the other in its upper 24 bits and the profile, in steps of 1/255, in the lower 8.
float pair_profile(uint pair) {
    return float(pair & 255u) * (1.0 / 255.0);
}

#endif
