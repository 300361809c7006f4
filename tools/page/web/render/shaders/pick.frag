// What the ray through one place of a picture meets: where half of what it gathers is gathered (mm along the viewing
// direction), its opacity, and V and the label there; as bits, since floats cannot be drawn everywhere. A mean depth could
// lie between two translucent layers, in the air. Or, of a voxel that is given: V and the label there, and O as opacity.
uniform vec2 at; // pixels from the upper left corner
uniform vec4 given; // voxel; w is 1 if there is one
out uvec4 met;

// O, whatever the opacities of objects leave of it.
float occupancy_at(vec3 place) {
    return medium_at(p.grid, place, image_place(p.grid, place)).y;
}

// Opacity per mm of what is shown at a place, but for the blur of the border: what is read is within the mask.
float opacity_at(vec3 place) {
    if (occupancy_at(place) < 0.5) return 0.0;
    vec2 here = field_at(place);
    if (OBJECTS == OWN_FUNCTIONS) return objects_shown(place, vec2(here.x), 1e30, here.y).a;
    return here.y * (1.0 - exp(-look_point(0u, here.x).a));
}

void main() {
    vec3 place = given.xyz;
    float depth = 0.0, opacity = 0.0;
    if (given.w == 0.0) {
        View v = views[VIEW];
        vec3 toward = ray_direction(v, ray_tangents(v, at, p.size));
        vec3 origin = to_voxel(vec4(v.eye, 1.0)), direction = to_voxel(vec4(toward, 0.0));
        direction = mix(direction, vec3(1e-20), lessThan(abs(direction), vec3(1e-20)));
        vec3 a = (-1.0 - origin) / direction, b = (vec3(p.grid.texels) - origin) / direction;
        vec3 enters = min(a, b), leaves = max(a, b);
        vec2 range = look_clipped(v.eye, toward, vec2(NEAREST, 3e38));
        range.x = max(range.x, max(enters.x, max(enters.y, enters.z)));
        range.y = min(range.y, min(leaves.x, min(leaves.y, leaves.z)));
        float len = length(toward), dz = p.cell / (float(p.parts) * len);
        // First all of the ray, then up to half of that.
        for (float enough = 1.0 - p.dark, whole = 0.0; whole < 2.0; whole += 1.0) {
            float clear = 1.0;
            for (depth = range.x + 0.5 * dz; depth < range.y && 1.0 - clear < enough; depth += dz) {
                place = origin + depth * direction;
                clear *= exp(dz * len * log(1.0 - min(opacity_at(place), 0.9995)));
            }
            depth -= dz;
            if (whole == 0.0) opacity = 1.0 - clear;
            enough = 0.5 * opacity;
        }
    }
    float label = labels_at(ivec3(atlas_place(p.grid, place) + 0.5)).x;
    met = floatBitsToUint(vec4(depth, given.w == 1.0 ? occupancy_at(place) : opacity, field_at(place).x, label * 255.0));
}
