// A triangle over the whole picture.
void main() {
    vec2 place = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = vec4(place * 4.0 - 1.0, 0.0, 1.0);
}
