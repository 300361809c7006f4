// Linear light of display-referred sRGB, for targets that turn light into sRGB by themselves (IEC 61966-2-1).
vec3 light_of(vec3 srgb) {
    return mix(srgb / 12.92, pow((srgb + 0.055) / 1.055, vec3(2.4)), greaterThan(srgb, vec3(0.04045)));
}
