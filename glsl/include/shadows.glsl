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

// What the curves' picture number `layer` holds at a place in parts of the image's sides. Not texelFetch, for which
// lavapipe 22.3 looks up the level of detail of each pixel by itself: of its instructions that is more than half.
vec4 read(vec2 at, int layer) {
    return textureLod(curves, vec3(at, float(layer)), 0.0);
}

// Of the medium alone, along the ray of the pixel whose centre is there.
float transmittance_until(Curve curve, vec2 at, float depth) {
    vec3 later = curve.firsts.yzw;
    int part = int(depth > later.x) + int(depth > later.y) + int(depth > later.z);
    vec4 from = read(at, 1 + part);
    vec4 to = vec4(from.yzw, part == 0 ? later.x : part == 1 ? later.y : part == 2 ? later.z : 3.0e38);
    float done = 4.0 * float(part) + growths_done(from, to, depth);
    return 1.0 - min(done * curve.growth, curve.opacity);
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
    float pixel; // how wide one is there
    bool is_seen;
};

Shown nowhere() {
    return Shown(vec3(0.0), vec2(0.0), 0.0, false);
}

void look_in(uint index, vec3 there, bool is_parallel, inout Shown shown) {
    LightPicture light = light_pictures[index];
    if (!is_parallel) there.xy /= there.z;
    there.y = -there.y;
    there.z -= light.rounding; // what lies on a surface is before it
    bool is_before = is_parallel || there.z > 0.0;
    // Four pixels of it are read.
    if (!shown.is_seen && is_before && max(abs(there.x), abs(there.y)) <= light.half_side - 1.0) {
        shown = Shown(there, light.middle + there.xy - 0.5, light.pixel * (is_parallel ? 1.0 : there.z), true);
    }
}

// Of a light whose pictures begin at `first`, and show parallel rays or not.
Shown look_for(uint first, vec3 point, bool is_parallel) {
    Shown shown = nowhere();
    for (uint i = 0; i < PICTURES; i++) look_in(first + i, in_picture(first + i, vec4(point, 1.0)), is_parallel, shown);
    return shown;
}

// A surface may slant, or be cut aslant: of the pixels around a point on it half show it nearer to the light, and the point would be in
// its own shadow. So along a pixel's ray the depth beneath the surface is what counts, where the four see one: it is flat, to half of a
// pixel, not too steep, in pixels a pixel, and not much farther than two pixels above the point. A pixel's surface is where a quarter to a
// half of its opacity is reached: where its medium begins is told by where a step of the light's ray does.
const float BUMPIEST = 0.5;
const float STEEPEST = 4.0;
const float NEAR_SURFACE = 2.0;

// How much the slant counts for a point at a depth, 0 to 1: `surfaces` are the depths of those in the four pixels around it, and `surface`
// is their mean at the point. So much of the difference of the two is added to the point's depth in each pixel.
float slant_at(vec4 surfaces, float surface, float depth, float pixel) {
    float least = min(min(surfaces.x, surfaces.y), min(surfaces.z, surfaces.w));
    float most = max(max(surfaces.x, surfaces.y), max(surfaces.z, surfaces.w));
    float bump = abs(surfaces.x - surfaces.y - surfaces.z + surfaces.w);
    // Where there is nothing it is at 0.
    bool is_one = least > 0.0 && most - least < STEEPEST * pixel && bump < BUMPIEST * pixel;
    return is_one ? clamp(2.0 - (depth - surface) / (NEAR_SURFACE * pixel), 0.0, 1.0) : 0.0;
}

// The part of the light that reaches a point which is shown there.
float let_through(Shown shown, bool is_parallel) {
    vec3 place = shown.place;
    vec2 low = floor(shown.corner);
    vec2 part = shown.corner - low;
    vec2 pixel = 1.0 / vec2(textureSize(curves, 0).xy);
    vec2 places[4];
    Curve around[4];
    vec4 surfaces;
    for (int j = 0; j < 4; j++) {
        places[j] = (low + vec2(j & 1, j >> 1) + 0.5) * pixel;
        vec4 numbers = read(places[j], 0);
        around[j] = unpacked(numbers);
        // Not silently: what is lit through this is not finite, and the host sees that.
        if (numbers.x == UNRESOLVED) around[j].opacity = uintBitsToFloat(0xff800000u);
        surfaces[j] = around[j].firsts.y;
    }
    vec2 rows = mix(surfaces.xz, surfaces.yw, part.x);
    float surface = mix(rows.x, rows.y, part.y);
    float slant = slant_at(surfaces, surface, place.z, shown.pixel);
    float sum = 0.0;
    for (int j = 0; j < 4; j++) {
        vec2 weights = mix(1.0 - part, part, vec2(j & 1, j >> 1));
        float through = transmittance_until(around[j], places[j], place.z + slant * (surfaces[j] - surface));
#ifdef SOLIDS
        vec4 blocker = textureLod(blockers, places[j], 0.0);
        if (blocker.w > 0.0 && place.z > blocker_depth(blocker.xyz, place.xy, is_parallel)) through = 0.0;
#endif
        sum += weights.x * weights.y * through;
    }
    return shown.is_seen ? sum : 1.0; // beside all that could stand in the way
}
