#version 450
#extension GL_ARB_shading_language_include : require
// Marks each pixel by what its ray meets.

#include "shell.glsl"
#include "crossings.glsl"
#include "marks.glsl"

void main() {
    int next;
    int last;
    bool is_begun;
    bool is_intricate = crossings_of(uvec2(gl_FragCoord.xy), next, last, is_begun);
    gl_FragDepth = next == last ? NOTHING_MARK : is_intricate ? INTRICATE_MARK : ALONE_MARK;
}
