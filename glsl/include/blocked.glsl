// Where the ray of a light's pixel is stopped by a solid.

#ifdef SOLIDS
#include "blocker.glsl"
layout(set = 0, binding = 14) uniform sampler2D blockers;
#endif

// The depth beyond which the ray need not be followed; `place` is that of the pixel, from the picture's middle.
float blocked_from(vec2 place, bool is_parallel) {
#ifdef SOLIDS
    vec4 blocker = texelFetch(blockers, ivec2(gl_FragCoord.xy), 0);
    if (blocker.w > 0.0) return deepest_read(blocker.xyz, place, is_parallel);
#endif
    return 3.0e38;
}
