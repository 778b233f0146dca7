#version 450
#extension GL_ARB_shading_language_include : require
// Marks pixels through which next to nothing is let: nothing more is drawn there.

#include "marks.glsl"
#include "medium.glsl"

layout(input_attachment_index = 0, set = 0, binding = 24) uniform subpassInput picture;

void main() {
    // Of a pixel that is left to the host alpha is infinite, and stays so.
    if (!(1.0 - subpassLoad(picture).a <= SATURATED)) discard;
    gl_FragDepth = SATURATED_MARK;
}
