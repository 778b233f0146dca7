#version 450
#extension GL_ARB_shading_language_include : require
// The upright rectangle around a cycle of tetrahedra, as two triangles.

#include "shell.glsl"

layout(set = 0, binding = 1, std430) readonly buffer Cycles { Cycle cycles[]; };

layout(location = 0) flat out uvec2 members; // first, end

const uint CORNERS[6] = uint[](0, 1, 2, 0, 2, 3);

void main() {
    Cycle cycle = cycles[gl_VertexIndex / 6];
    members = cycle.members;
    uint corner = CORNERS[gl_VertexIndex % 6];
    bool right = corner == 1 || corner == 2;
    bool low = corner >= 2;
    gl_Position = vec4(right ? cycle.bounds.z : cycle.bounds.x, low ? cycle.bounds.w : cycle.bounds.y, 0.0, 1.0);
}
