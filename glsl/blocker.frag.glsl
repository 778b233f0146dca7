#version 450
#extension GL_ARB_shading_language_include : require
// The nearest solid in a pixel of a light's picture. Not its depth there but the function that tells it at any place of the
// picture is kept, so that a plane casts no shadow on itself however steep it is (receiver and blocker agree on its depth).

#include "picture.glsl"
#include "blocker.glsl"

layout(location = 0) flat in vec3 depth_function;
layout(location = 1) flat in uint picture;

layout(location = 0) out vec4 out_blocker; // the fourth: whether there is any

void main() {
    LightPicture light = light_pictures[picture];
    vec2 place = gl_FragCoord.xy - light.middle;
    if (max(abs(place.x), abs(place.y)) > light.half_side) discard; // in the next picture
    float depth = blocker_depth(depth_function, place, light.is_parallel != 0);
    if (!(depth > 0.0)) discard;
    out_blocker = vec4(depth_function, 1.0);
    gl_FragDepth = 1.0 / (1.0 + depth);
}
