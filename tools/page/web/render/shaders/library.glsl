// What all fragment shaders of the page have before their own lines.
#include "march.glsl"
#include "inputs.glsl"
