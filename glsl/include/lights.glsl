// The lights of a scene, and what of them reaches a point. Points are in world space with the origin at the eye, in parts of
// `Seen::unit`.

struct LightSource {
    vec4 place;  // towards it, or where it is; 1 / falloff, 0 where there is none
    vec4 colour; // the fourth: 0 directional, 1 a point
    uvec2 pictures; // range of its pictures: first, end; empty where it casts no shadow
};

layout(set = 0, binding = 5, std430) readonly buffer Lighting {
    vec4 world_from_view[3]; // columns
    vec3 ambient;
    float diffuse;
    float specular;
    float shininess;
    uint count;
    float glow;
    float glow_from;
    LightSource sources[];
} lighting;

#ifdef SHADOWS
#include "shadows.glsl"
#endif

// The light that reaches a point, and the unit vector towards it. Its shadow is that of a point `off` it, which is off a surface
// that would else cast a shadow on itself.
vec3 arriving(LightSource light, vec3 point, vec3 off, out vec3 to_light) {
    vec3 colour = light.colour.rgb;
    if (light.colour.w == 0.0) {
        to_light = light.place.xyz;
    } else {
        vec3 way = light.place.xyz - point;
        float distance = length(way);
        to_light = distance > 0.0 ? way / distance : vec3(0.0);
        float falls = distance * light.place.w;
        colour /= 1.0 + falls * falls;
    }
#ifdef SHADOWS
    colour *= let_through(light.pictures, point + off);
#endif
    return colour;
}
