// The colour of a point in a lit scene: src/scene/shading.rs defines it.

#include "frame.glsl"
#include "lights.glsl"

layout(constant_id = 3) const bool FIBRE = false; // directions are tangents; else normals

layout(constant_id = 4) const bool GLOW = false; // whether bright colours do

layout(set = 0, binding = 9) uniform sampler3D directions; // times their weight, which is the fourth

// A point, as light meets it.
struct Spot {
    float depth;    // along the ray
    vec3 direction; // of the texture, unit length; 0 where it has none
    float agreement;
};

// What is the same all along a ray; lavapipe takes nothing out of loops by itself.
vec3 world_ray; // at unit depth
vec3 to_eye;
// Of each light that is infinitely far.
vec3 diffuse[UNROLLED];
vec3 specular[UNROLLED];
vec3 half_ways[UNROLLED]; // between the eye and it, unit length or 0
#ifdef SHADOWS
vec3 at_eye[UNROLLED];    // in its picture: of the ray's start,
vec3 from_depth[UNROLLED]; // and its change per unit of depth
#endif

bool is_known(uint light) {
    return light < UNROLLED && light < LIGHTS && !is_point(light);
}

vec3 half_way_to(vec3 to_light) {
    vec3 sum = to_light + to_eye;
    float size = length(sum);
    return size > 0.0 ? sum / size : vec3(0.0);
}

// Must be called before a point on a ray is lit.
void look_along(vec3 ray) {
    world_ray = lighting.world_from_view[0].xyz * ray.x + lighting.world_from_view[1].xyz * ray.y
        + lighting.world_from_view[2].xyz * ray.z;
    to_eye = -normalize(world_ray);
    for (uint i = 0; i < UNROLLED; i++) {
        if (!is_known(i)) continue;
        vec3 to_light;
        vec3 light = shining(i, vec3(0.0), to_light);
        diffuse[i] = light * lighting.diffuse;
        specular[i] = light * lighting.specular;
        half_ways[i] = half_way_to(to_light);
#ifdef SHADOWS
        if (casts_shadows(i) && PICTURES == 1) {
            at_eye[i] = in_picture(first_picture(i), vec4(vec3(0.0), 1.0));
            from_depth[i] = in_picture(first_picture(i), vec4(world_ray, 0.0));
        }
#endif
    }
}

// Adds what it scatters and mirrors of a light.
void add_light(uint index, Spot spot, inout vec3 scattered, inout vec3 mirrored) {
    vec3 to_light;
    vec3 light = shining(index, spot.depth * world_ray, to_light);
    vec3 of_diffuse = light * lighting.diffuse;
    vec3 of_specular = light * lighting.specular;
    vec3 half_way = half_way_to(to_light);
    if (is_known(index)) {
        of_diffuse = diffuse[min(index, UNROLLED - 1)];
        of_specular = specular[min(index, UNROLLED - 1)];
        half_way = half_ways[min(index, UNROLLED - 1)];
    }
    float along = dot(spot.direction, to_light);
    float aligned;
    float lobe;
    if (FIBRE) {
        float along_eye = dot(spot.direction, to_eye);
        aligned = sqrt(max(1.0 - along * along, 0.0));
        float off_cone = aligned * sqrt(max(1.0 - along_eye * along_eye, 0.0)) - along * along_eye;
        lobe = pow(max(off_cone, 0.0), lighting.shininess);
    } else {
        aligned = max(along, 0.0);
        lobe = aligned * pow(max(dot(spot.direction, half_way), 0.0), lighting.shininess);
    }
#ifdef SHADOWS
    if (casts_shadows(index)) {
        uint first = first_picture(index);
        Shown shown = nowhere();
        if (is_known(index) && PICTURES == 1) {
            uint known = min(index, UNROLLED - 1);
            look_in(first, at_eye[known] + spot.depth * from_depth[known], true, shown);
        } else {
            shown = look_for(first, spot.depth * world_ray, !is_point(index));
        }
        float through = let_through(shown, !is_point(index));
        of_diffuse *= through;
        of_specular *= through;
    }
#endif
    float mean = FIBRE ? 0.78539816339744831 : 0.25; // pi / 4: see src/scene/shading.rs
    scattered += of_diffuse * mix(mean, aligned, spot.agreement);
    mirrored += of_specular * (spot.agreement * lobe);
}

// A texel as it is lit, with its weighted direction: its alpha, and the colour that it sends to the eye, premultiplied as before.
vec4 lit(vec4 texel, vec4 weighted, float depth) {
    if (!(texel.a > LEAST)) return texel;
    vec3 direction = (frame_at_eye + depth * frame_from_depth) * weighted.xyz;
    float size = length(direction);
    bool has_direction = weighted.w > LEAST && size > LEAST;
    direction = has_direction ? direction / size : vec3(0.0);
    float agreement = has_direction ? min(length(weighted.xyz) / weighted.w, 1.0) : 0.0;

    Spot spot = Spot(depth, direction, agreement);
    vec3 scattered = lighting.ambient;
    vec3 mirrored = vec3(0.0);
    // UNROLLED by hand: few scenes have more.
    if (LIGHTS > 0) add_light(0, spot, scattered, mirrored);
    if (LIGHTS > 1) add_light(1, spot, scattered, mirrored);
    if (LIGHTS > 2) add_light(2, spot, scattered, mirrored);
    if (LIGHTS > 3) add_light(3, spot, scattered, mirrored);
    for (uint i = UNROLLED; i < LIGHTS; i++) add_light(i, spot, scattered, mirrored);
    if (GLOW) {
        float brightest = max(texel.r, max(texel.g, texel.b)) / texel.a;
        scattered += lighting.glow * clamp((brightest - lighting.glow_from) / (1.0 - lighting.glow_from), 0.0, 1.0);
    }
    return vec4(texel.rgb * scattered + texel.a * mirrored, texel.a);
}

// As `fetch`, lit.
vec4 radiant(Path path, float depth) {
    return lit(fetch(path, depth), fetch_from(directions, path, depth), depth);
}
