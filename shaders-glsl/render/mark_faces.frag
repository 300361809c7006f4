#version 460
// Nothing is drawn but the depth of a face.
void main() {}
