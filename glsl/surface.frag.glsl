#version 450
#extension GL_ARB_shading_language_include : require
// switches: LIT SHADOWS(LIT)
// The colour of a solid where it is the nearest in a pixel: src/scene/solid.rs. So each pixel is lit once, however many triangles
// cover it.

#define SOLIDS
#include "shell.glsl"
#include "ray.glsl"
#ifdef LIT
#include "lights.glsl"
#endif

layout(set = 0, binding = 17) uniform sampler3D surface; // one texel along w

layout(set = 0, binding = 23) uniform samplerBuffer faces; // of src/method/shell/solids.rs, seven texels each

layout(set = 0, binding = 15) uniform sampler2D nearest; // as solid.frag.glsl writes it

layout(location = 0) flat in uvec2 members; // range of the solid's triangles: first, end

layout(location = 0) out vec4 out_rgba;

// How a triangle's surface looks. All rows are affine in the point, in view space: dot(row.xyz, point) + row.w.
struct Face {
    vec4 texture[2];   // u and v
    vec4 normal[3];    // in world space, as the vertices' are interpolated
    vec4 facing;       // the plane's normal on the eye's side, in world space; how far points are moved off it to look up their shadow
    vec4 colour;       // the fourth: texels of the full texture in a unit of length
};

Face face_of(uint triangle) {
    int first = 7 * int(triangle);
    Face face;
    for (int i = 0; i < 2; i++) face.texture[i] = texelFetch(faces, first + i);
    for (int i = 0; i < 3; i++) face.normal[i] = texelFetch(faces, first + 2 + i);
    face.facing = texelFetch(faces, first + 5);
    face.colour = texelFetch(faces, first + 6);
    return face;
}

float along(vec4 row, vec3 point) {
    return dot(row.xyz, point) + row.w;
}

#ifdef LIT
// Adds what it scatters and mirrors of a light, at a point in world space.
void add_light(uint index, vec3 at, Face face, vec3 normal, vec3 to_eye, inout vec3 scattered, inout vec3 mirrored) {
    vec3 facing = face.facing.xyz;
    vec3 to_light;
    vec3 light = arriving(index, at, face.facing.w * facing, to_light);
    if (!(dot(facing, to_light) > 0.0)) return;
    vec3 half_way = normalize(to_light + to_eye);
    float aligned = max(dot(normal, to_light), 0.0);
    scattered += light * lighting.diffuse * aligned;
    mirrored += light * lighting.specular * aligned * pow(max(dot(normal, half_way), 0.0), lighting.shininess);
}
#endif

void main() {
    vec4 found = texelFetch(nearest, ivec2(gl_FragCoord.xy), 0);
    uint triangle_index = uint(found.y) | uint(found.z) << 16;
    if (found.x == 0.0 || triangle_index < members.x || triangle_index >= members.y) discard;
    Face face = face_of(triangle_index);
    float depth = found.x;
    vec3 point = depth * pixel_ray();
    vec3 place = vec3(along(face.texture[0], point), along(face.texture[1], point), 0.5);
    float last = float(textureQueryLevels(surface) - 1);
    float level = clamp(log2(view.lod_scale * depth * face.colour.w), 0.0, last);
    float fine = floor(level);
    vec3 colour = face.colour.rgb
        * mix(textureLod(surface, place, fine), textureLod(surface, place, min(fine + 1.0, last)), level - fine).rgb;
#ifdef LIT
    vec3 at = mat3(lighting.world_from_view[0].xyz, lighting.world_from_view[1].xyz, lighting.world_from_view[2].xyz) * point;
    vec3 to_eye = -normalize(at);
    vec3 normal = normalize(vec3(along(face.normal[0], point), along(face.normal[1], point), along(face.normal[2], point)));
    vec3 scattered = lighting.ambient;
    vec3 mirrored = vec3(0.0);
    // UNROLLED by hand.
    if (LIGHTS > 0) add_light(0, at, face, normal, to_eye, scattered, mirrored);
    if (LIGHTS > 1) add_light(1, at, face, normal, to_eye, scattered, mirrored);
    if (LIGHTS > 2) add_light(2, at, face, normal, to_eye, scattered, mirrored);
    if (LIGHTS > 3) add_light(3, at, face, normal, to_eye, scattered, mirrored);
    for (uint i = UNROLLED; i < LIGHTS; i++) add_light(i, at, face, normal, to_eye, scattered, mirrored);
    colour = colour * scattered + mirrored;
#endif
    out_rgba = vec4(colour, 1.0);
}
