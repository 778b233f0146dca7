#version 450
#extension GL_ARB_shading_language_include : require
// switches: LIGHT WALKED(LIGHT)
// A rectangle of pixels as two triangles.

#include "shell.glsl"

layout(set = 0, binding = 1, std430) readonly buffer Tiles { Tile tiles[]; };

#ifndef WALKED
layout(location = 0) flat out uvec2 members; // range of what is seen there: first, end
#endif
#ifdef LIGHT
layout(location = 1) flat out uint picture;
#ifndef WALKED
layout(location = 2) flat out uint coarsely;
#endif
#endif

const uint CORNERS[6] = uint[](0, 1, 2, 0, 2, 3);

void main() {
    Tile tile = tiles[gl_VertexIndex / 6];
#ifndef WALKED
    members = tile.members;
#endif
#ifdef LIGHT
    picture = tile.picture;
#ifndef WALKED
    coarsely = tile.coarsely;
#endif
#endif
    uint corner = CORNERS[gl_VertexIndex % 6];
    bool right = corner == 1 || corner == 2;
    bool low = corner >= 2;
#ifdef WALKED
    const float nearness = 1.0;
#else
    // Where a depth is kept, that of pixels for which it was drawn as WALKED is nearer; where pixels are marked, those that are saturated.
    const float nearness = 0.5;
#endif
    gl_Position = vec4(right ? tile.bounds.z : tile.bounds.x, low ? tile.bounds.w : tile.bounds.y, nearness, 1.0);
}
