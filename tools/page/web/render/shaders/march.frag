// Marches the ray of a pixel, as shaders-glsl/render/raymarch.frag does.
uniform vec4 port; // left, lower edge, width and height of the picture in the framebuffer, pixels
uniform vec4 background; // premultiplied
out vec4 colour;

void main() {
    vec2 place = vec2(gl_FragCoord.x - port.x, port.y + port.w - gl_FragCoord.y);
    Gathered gathered = march(place, VIEW, true);
    colour = gathered.colour + (1.0 - gathered.colour.a) * background;
}
