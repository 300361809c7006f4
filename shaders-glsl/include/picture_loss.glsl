// The loss of a picture: (1 - λ) mean |C - C*| + λ (1 - mean SSIM), as of Kerbl et al. 2023, over pixels and channels.
// SSIM is that of Wang et al. 2004: windows of 11 pixels, Gaussian of 1.5 pixels, range 1; beside the picture is 0.
#ifndef PICTURE_LOSS_GLSL
#define PICTURE_LOSS_GLSL

const uint LOSS_TILE = 16;
const uint WINDOW_REACH = 5;
const uint LOSS_PATCH = 26; // a tile with its windows
// An invocation filters as many neighbours at once: their windows overlap, and shared memory is read once for all.
const uint RUN = 4;
const uint RUN_READS = RUN + 2 * WINDOW_REACH;
const uint RUNS = LOSS_TILE / RUN; // of a row or a column of a tile
const float WINDOW[11] = float[11](0.00102838, 0.00759876, 0.03600077, 0.10936069, 0.21300554, 0.26601172, 0.21300554,
                                   0.10936069, 0.03600077, 0.00759876, 0.00102838);
const float SSIM_C1 = 0.0001;
const float SSIM_C2 = 0.0009;

#endif
