#version 450
#extension GL_ARB_shading_language_include : require
// The nearest solid in each pixel. Where the ray meets the triangle is found exactly; the rasteriser only says which triangles to
// look at.

#include "shell.glsl"
#include "ray.glsl"

layout(location = 0) flat in uint triangle_index;
layout(location = 1) flat in vec4 plane;

layout(location = 0) out vec4 out_nearest; // depth, and the number of the triangle in two halves

void main() {
    float depth = plane.w / dot(plane.xyz, pixel_ray());
    if (!(depth >= view.near)) discard; // edge-on
    out_nearest = vec4(depth, float(triangle_index & 0xffffu), float(triangle_index >> 16), 1.0);
    gl_FragDepth = 1.0 / (1.0 + depth);
}
