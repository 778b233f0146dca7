#version 450
#extension GL_ARB_shading_language_include : require
// A triangle of a solid.

#include "shell.glsl"
#include "triangle.glsl"

layout(location = 0) flat out uint triangle_index;
layout(location = 1) flat out vec4 plane;

void main() {
    triangle_index = gl_VertexIndex / 3;
    plane = triangles[triangle_index].plane;
    vec3 corner = triangles[triangle_index].corners[gl_VertexIndex % 3].xyz;
    // Nothing before the near plane.
    gl_Position = vec4(vec2(corner.x, -corner.y) / (view.pixel * view.centre), view.near, corner.z);
}
