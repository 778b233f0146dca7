#version 450
#extension GL_ARB_shading_language_include : require
// switches: TOGETHER
// Squares of pixels that cover the picture, row by row, as two triangles each: parts in which it may be drawn. Their depth is between
// the marks of the pixels that are and of the others.

#include "shell.glsl"
#include "marks.glsl"

const uint SIDE = 64; // as in src/method/shell/squares.rs

const uint CORNERS[6] = uint[](0, 1, 2, 0, 2, 3);

void main() {
    uint columns = (uint(2.0 * view.centre.x) + SIDE - 1) / SIDE;
    uint square = gl_VertexIndex / 6;
    uint corner = CORNERS[gl_VertexIndex % 6];
    uvec2 at = uvec2(square % columns, square / columns) + uvec2(corner == 1 || corner == 2, corner >= 2);
#ifdef TOGETHER
    const float depth = mix(INTRICATE_MARK, NOTHING_MARK, 0.5);
#else
    const float depth = mix(ALONE_MARK, NOTHING_MARK, 0.5);
#endif
    gl_Position = vec4(vec2(at * SIDE) / view.centre - 1.0, depth, 1.0);
}
