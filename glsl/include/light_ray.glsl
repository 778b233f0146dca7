// The ray of a pixel of a light's picture, as src/scene/shadow.rs defines it, and the solid at which it ends.

#ifdef SOLIDS
#include "blocker.glsl"
#endif

struct LightRay {
    vec3 origin;
    vec3 along;     // of unit depth
    float farthest; // a solid is there: beyond, it need not be followed
};

LightRay ray_of(LightPicture light) {
    vec2 place = gl_FragCoord.xy - light.middle;
    vec3 beside = vec3(place * vec2(light.pixel, -light.pixel), 0.0);
    bool is_parallel = light.is_parallel != 0;
    LightRay ray = LightRay(is_parallel ? beside : vec3(0.0), vec3(is_parallel ? vec2(0.0) : beside.xy, 1.0), 3.0e38);
#ifdef SOLIDS
    vec4 blocker = texelFetch(blockers, ivec2(gl_FragCoord.xy), 0);
    if (blocker.w > 0.0) ray.farthest = deepest_read(blocker.xyz, place, is_parallel);
#endif
    return ray;
}
