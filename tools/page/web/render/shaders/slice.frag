// A plane through the field: V in grey between the ends of a window, faded by O. `from` is the voxel at the upper left
// corner of the picture, the others are how voxels go on to the right and downwards, for the whole picture.
uniform vec3 from, across, down;
uniform vec2 window; // its lower end and width
uniform vec2 size;   // pixels
out vec4 colour;

void main() {
    vec2 part = vec2(gl_FragCoord.x, size.y - gl_FragCoord.y) / size;
    vec3 at = from + part.x * across + part.y * down;
    bool inside = all(greaterThan(at, vec3(-1.0))) && all(lessThan(at, vec3(p.grid.texels)));
    vec2 found = inside ? field_at(at) : vec2(0.0);
    float grey = clamp((found.x - window.x) / window.y, 0.0, 1.0);
    colour = vec4(vec3(grey), 1.0) * smoothstep(0.25, 0.75, found.y);
}
