#version 450
#extension GL_ARB_shading_language_include : require
// switches: LIT
// The outline of a tetrahedron as two triangles; what shell.frag.glsl needs of it goes along unchanged.

#include "shell.glsl"

layout(set = 0, binding = 0, std430) readonly buffer Cells { Cell cells[]; };
layout(set = 0, binding = 2, std430) readonly buffer List { uint list[]; }; // of cells, front to back

layout(location = 0) flat out vec4 planes[4];
layout(location = 4) flat out vec4 texture_rows[3];
#ifdef LIT
layout(location = 7) flat out uint cell_index;
#endif

const uint CORNERS[6] = uint[](0, 1, 2, 0, 2, 3);

void main() {
    uint index = list[gl_VertexIndex / 6];
    Cell cell = cells[index];
    planes = cell.planes;
    texture_rows = cell.texture;
#ifdef LIT
    cell_index = index;
#endif
    uint corner = CORNERS[gl_VertexIndex % 6];
    vec4 pair = cell.outline[corner / 2];
    const float nearness = 0.5; // between the marks of pixels in which it is seen, and in which not
    gl_Position = vec4(corner % 2 == 0 ? pair.xy : pair.zw, nearness, 1.0);
}
