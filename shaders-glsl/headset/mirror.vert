#version 460
// A triangle over the whole window.
void main() {
    vec2 place = vec2(float(gl_VertexIndex & 1) * 2.0, float(gl_VertexIndex >> 1) * 2.0);
    gl_Position = vec4(place * 2.0 - 1.0, 0.0, 1.0);
}
