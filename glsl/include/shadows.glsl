// What stands between a light and a point: read from the light's pictures, the mean of the four pixels around the point.

#include "picture.glsl"
#include "curve.glsl"

layout(set = 0, binding = 10) uniform sampler2DArray curves;
#ifdef SOLIDS
#include "blocker.glsl"
#endif

// How many of the growths from knot to knot are done at a depth; knots may coincide.
float growths_done(vec4 from, vec4 to, float depth) {
    return dot(clamp((depth - from) / max(to - from, 1e-7), 0.0, 1.0), vec4(1.0));
}

// Of the medium alone, along the ray of the pixel whose centre is there, in parts of the image's sides. Not texelFetch, for which
// lavapipe 22.3 looks up the level of detail of each pixel by itself: of its instructions that is more than half.
float transmittance_until(vec2 at, float depth) {
    vec4 whole = textureLod(curves, vec3(at, 0.0), 0.0);
    // Not silently: what is lit by this is not finite, and the host sees that.
    if (whole.x == UNRESOLVED) return uintBitsToFloat(0x7f800000u);
    float doublings = floor(0.5 * whole.x);
    float opacity_of_all = whole.x - 2.0 * doublings;
    int part = int(depth > whole.y) + int(depth > whole.z) + int(depth > whole.w);
    vec4 from = textureLod(curves, vec3(at, float(1 + part)), 0.0);
    vec4 to = vec4(from.yzw, part == 0 ? whole.y : part == 1 ? whole.z : part == 2 ? whole.w : 3.0e38);
    float done = 4.0 * float(part) + growths_done(from, to, depth);
    // The power of two as its bits: an eighth of what `exp2` takes.
    float growth = uintBitsToFloat(uint(127.0 + doublings) << 23) * LEAST_GROWTH;
    return opacity_of_all == 0.0 ? 1.0 : 1.0 - min(done * growth, opacity_of_all);
}

// Of a light whose pictures begin at `first`, and show parallel rays or not.
float let_through(uint first, bool is_parallel, vec3 point) {
    // Where the point is in the picture that it is in, if in any.
    vec3 place = vec3(0.0);
    vec2 corner = vec2(0.0);
    bool is_seen = false;
    for (uint i = 0; i < PICTURES; i++) {
        LightPicture light = light_pictures[first + i];
        vec4 at = vec4(point, 1.0);
        vec3 there = vec3(dot(light.from_world[0], at), dot(light.from_world[1], at), dot(light.from_world[2], at));
        if (!is_parallel) there.xy /= there.z;
        there.y = -there.y;
        bool is_before = is_parallel || there.z > 0.0;
        // Four pixels of it are read.
        if (!is_seen && is_before && max(abs(there.x), abs(there.y)) <= light.half_side - 1.0) {
            place = there;
            corner = light.middle + there.xy - 0.5;
            is_seen = true;
        }
    }
    vec2 low = floor(corner);
    vec2 part = corner - low;
    vec2 pixel = 1.0 / vec2(textureSize(curves, 0).xy);
    float sum = 0.0;
    for (int j = 0; j < 4; j++) {
        ivec2 offset = ivec2(j & 1, j >> 1);
        vec2 weights = mix(1.0 - part, part, vec2(offset));
        vec2 at = (low + vec2(offset) + 0.5) * pixel;
        float through = transmittance_until(at, place.z);
#ifdef SOLIDS
        vec4 blocker = textureLod(blockers, at, 0.0);
        if (blocker.w > 0.0 && place.z > blocker_depth(blocker.xyz, place.xy, is_parallel)) through = 0.0;
#endif
        sum += weights.x * weights.y * through;
    }
    return is_seen ? sum : 1.0; // beside all that could stand in the way
}
