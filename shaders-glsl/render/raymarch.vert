#version 460
// A triangle over the whole picture, nearer than the marks of faces (mark_faces.vert): only what they cover lies
// behind it, and gets fragments.
void main() {
    vec2 place = vec2(float(gl_VertexIndex & 1) * 2.0, float(gl_VertexIndex >> 1) * 2.0);
    gl_Position = vec4(place * 2.0 - 1.0, 0.25, 1.0);
}
