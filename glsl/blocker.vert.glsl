#version 450
#extension GL_ARB_shading_language_include : require
// A triangle of a solid as a light sees it.

#include "shell.glsl"
#include "picture.glsl"
#include "blocker.glsl"

layout(set = 0, binding = 7, std430) readonly buffer Blockers { Blocker blockers[]; };

layout(location = 0) flat out vec3 depth_function;
layout(location = 1) flat out uint picture;

void main() {
    Blocker blocker = blockers[gl_VertexIndex / 3];
    LightPicture light = light_pictures[blocker.picture];
    depth_function = blocker.depth_function.xyz;
    picture = blocker.picture;
    vec3 corner = blocker.corners[gl_VertexIndex % 3].xyz;
    bool is_parallel = light.is_parallel != 0;
    float w = is_parallel ? 1.0 : corner.z;
    vec2 place = light.middle * w + vec2(corner.x, -corner.y) / light.pixel;
    // Nothing before the light's own near plane.
    gl_Position = vec4(place / view.centre - w, is_parallel ? 0.5 : view.near, w);
}
