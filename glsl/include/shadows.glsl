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

// The pixel beside its middle, to the right and upwards, and depth of a point, `vec4(point, 1)`, or of a way, `vec4(way, 0)`, in a light's
// picture; of one that shows no parallel rays the pixel times the depth.
vec3 in_picture(uint index, vec4 at) {
    LightPicture light = light_pictures[index];
    return vec3(dot(light.from_world[0], at), dot(light.from_world[1], at), dot(light.from_world[2], at));
}

// Where a point is in a light's picture that it is in, if in any.
struct Shown {
    vec3 place;  // the pixel beside the middle, to the right and downwards, and the depth
    vec2 corner; // of the image, half a pixel up and left of it
    bool is_seen;
};

Shown nowhere() {
    return Shown(vec3(0.0), vec2(0.0), false);
}

void look_in(uint index, vec3 there, bool is_parallel, inout Shown shown) {
    LightPicture light = light_pictures[index];
    if (!is_parallel) there.xy /= there.z;
    there.y = -there.y;
    bool is_before = is_parallel || there.z > 0.0;
    // Four pixels of it are read.
    if (!shown.is_seen && is_before && max(abs(there.x), abs(there.y)) <= light.half_side - 1.0) {
        shown = Shown(there, light.middle + there.xy - 0.5, true);
    }
}

// Of a light whose pictures begin at `first`, and show parallel rays or not.
Shown look_for(uint first, vec3 point, bool is_parallel) {
    Shown shown = nowhere();
    for (uint i = 0; i < PICTURES; i++) look_in(first + i, in_picture(first + i, vec4(point, 1.0)), is_parallel, shown);
    return shown;
}

// The part of the light that reaches a point which is shown there.
float let_through(Shown shown, bool is_parallel) {
    vec3 place = shown.place;
    vec2 low = floor(shown.corner);
    vec2 part = shown.corner - low;
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
    return shown.is_seen ? sum : 1.0; // beside all that could stand in the way
}
