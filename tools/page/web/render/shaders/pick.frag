// What the ray through one place of a picture meets: its mean depth (mm along the viewing direction), its opacity, and V
// and the label there; as bits, since floats cannot be drawn everywhere.
uniform vec2 at; // pixels from the upper left corner
out uvec4 met;

void main() {
    Gathered gathered = march(at, VIEW, true);
    float depth = gathered.depth / max(gathered.colour.a, 1e-6);
    View v = views[VIEW];
    vec3 place = to_voxel(vec4(v.eye + depth * ray_direction(v, ray_tangents(v, at, p.size)), 1.0));
    float label = labels_at(ivec3(atlas_place(p.grid, place) + 0.5)).x;
    vec4 found = vec4(depth, gathered.colour.a, field_at(place).x, label * 255.0);
    met = floatBitsToUint(found);
}
