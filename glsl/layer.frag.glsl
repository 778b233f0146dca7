#version 450
#extension GL_ARB_shading_language_include : require
// switches: DEPTH
// What the medium leaves of the solids' picture, which lies behind it.

#include "shell.glsl"
#include "ray.glsl"

layout(set = 0, binding = 15) uniform sampler2D solid_depths;
layout(set = 0, binding = 16) uniform sampler2D solid_colours;

layout(location = 0) out vec4 out_rgba;
#ifdef DEPTH
layout(location = 1) out vec4 out_depth; // (distance * alpha, 0, 0, alpha)
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    out_rgba = texelFetch(solid_colours, pixel, 0);
    if (out_rgba.a == 0.0) discard;
#ifdef DEPTH
    out_depth = vec4(texelFetch(solid_depths, pixel, 0).x * length(pixel_ray()), 0.0, 0.0, 1.0);
#endif
}
