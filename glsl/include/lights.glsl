// The lights of a scene, and what of them reaches a point. Points are in world space with the origin at the eye, in parts of
// `Seen::unit`.

// How many; which cast shadows, a bit each; how many pictures each of those has; and which shine from a point. Known to the compiler, so
// that where a loop over lights is unrolled, what is read of them is at places that it knows: lavapipe reads that once for all pixels.
layout(constant_id = 7) const uint LIGHTS = 0;
layout(constant_id = 8) const uint CASTING_LOW = 0;
layout(constant_id = 9) const uint CASTING_HIGH = 0; // from the 33rd light on
layout(constant_id = 10) const uint PICTURES = 1;
layout(constant_id = 11) const uint POINTS_LOW = 0; // those that shine from a point, not from infinitely far
layout(constant_id = 12) const uint POINTS_HIGH = 0;

// Those that are no loop, but written out: few scenes have more.
const uint UNROLLED = 4;

const uint MOST_LIGHTS = 64;
const uint MOST_PICTURES = 6 * MOST_LIGHTS;

struct LightSource {
    vec4 place;  // towards it, or where it is; 1 / falloff, 0 where there is none
    vec4 colour; // and nothing
};

layout(set = 0, binding = 5, std140) uniform Lighting {
    vec4 world_from_view[3]; // columns
    vec3 ambient;
    float diffuse;
    float specular;
    float shininess;
    float glow;
    float glow_from;
    LightSource sources[MOST_LIGHTS];
} lighting;

bool is_point(uint light) {
    return (((light < 32 ? POINTS_LOW : POINTS_HIGH) >> (light & 31)) & 1) != 0;
}

#ifdef SHADOWS
#include "shadows.glsl"

bool casts_shadows(uint light) {
    return (((light < 32 ? CASTING_LOW : CASTING_HIGH) >> (light & 31)) & 1) != 0;
}

// In `light_pictures`.
uint first_picture(uint light) {
    uint before = (1u << (light & 31)) - 1;
    uint casting = light < 32 ? bitCount(CASTING_LOW & before) : bitCount(CASTING_LOW) + bitCount(CASTING_HIGH & before);
    return casting * PICTURES;
}
#endif

// What arrives of a light at a point if nothing stands in its way, and the unit vector towards it.
vec3 shining(uint index, vec3 point, out vec3 to_light) {
    LightSource light = lighting.sources[index];
    vec3 colour = light.colour.rgb;
    to_light = light.place.xyz;
    if (is_point(index)) {
        vec3 way = light.place.xyz - point;
        float distance = length(way);
        to_light = distance > 0.0 ? way / distance : vec3(0.0);
        float falls = distance * light.place.w;
        colour /= 1.0 + falls * falls;
    }
    return colour;
}

// The light that reaches a point, and the unit vector towards it. Its shadow is that of a point `off` it, which is off a surface
// that would else cast a shadow on itself.
vec3 arriving(uint index, vec3 point, vec3 off, out vec3 to_light) {
    vec3 colour = shining(index, point, to_light);
#ifdef SHADOWS
    if (casts_shadows(index)) colour *= let_through(look_for(first_picture(index), point + off, !is_point(index)), !is_point(index));
#endif
    return colour;
}
