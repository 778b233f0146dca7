#version 450
#extension GL_ARB_shading_language_include : require
// switches: LIT SHADOWS(LIT)
// The colour of a solid where it is the nearest in a pixel: src/scene/solid.rs. So each pixel is lit once, however many triangles
// cover it.

#define SOLIDS
#include "shell.glsl"
#include "ray.glsl"
#include "triangle.glsl"
#ifdef LIT
#include "lights.glsl"
#endif

layout(set = 0, binding = 17) uniform sampler3D surface; // one texel along w

layout(set = 0, binding = 15) uniform sampler2D nearest; // as solid.frag.glsl writes it

layout(location = 0) flat in uvec2 members; // range of the solid's triangles: first, end

layout(location = 0) out vec4 out_rgba;

float along(vec4 row, vec3 point) {
    return dot(row.xyz, point) + row.w;
}

void main() {
    vec4 found = texelFetch(nearest, ivec2(gl_FragCoord.xy), 0);
    uint triangle_index = uint(found.y) | uint(found.z) << 16;
    if (found.x == 0.0 || triangle_index < members.x || triangle_index >= members.y) discard;
    Triangle triangle = triangles[triangle_index];
    float depth = found.x;
    vec3 point = depth * pixel_ray();
    vec3 place = vec3(along(triangle.texture[0], point), along(triangle.texture[1], point), 0.5);
    float last = float(textureQueryLevels(surface) - 1);
    float level = clamp(log2(view.lod_scale * depth * triangle.colour.w), 0.0, last);
    float fine = floor(level);
    vec3 colour = triangle.colour.rgb
        * mix(textureLod(surface, place, fine), textureLod(surface, place, min(fine + 1.0, last)), level - fine).rgb;
#ifdef LIT
    vec3 at = mat3(lighting.world_from_view[0].xyz, lighting.world_from_view[1].xyz, lighting.world_from_view[2].xyz) * point;
    vec3 to_eye = -normalize(at);
    vec3 facing = triangle.facing.xyz;
    vec3 normal = normalize(vec3(along(triangle.normal[0], point), along(triangle.normal[1], point), along(triangle.normal[2], point)));
    vec3 scattered = lighting.ambient;
    vec3 mirrored = vec3(0.0);
    for (uint i = 0; i < LIGHTS; i++) {
        vec3 to_light;
        vec3 light = arriving(i, at, triangle.facing.w * facing, to_light);
        if (!(dot(facing, to_light) > 0.0)) continue;
        vec3 half_way = normalize(to_light + to_eye);
        float aligned = max(dot(normal, to_light), 0.0);
        scattered += light * lighting.diffuse * aligned;
        mirrored += light * lighting.specular * aligned * pow(max(dot(normal, half_way), 0.0), lighting.shininess);
    }
    colour = colour * scattered + mirrored;
#endif
    out_rgba = vec4(colour, 1.0);
}
