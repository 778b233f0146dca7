#version 450
#extension GL_ARB_shading_language_include : require
// switches: LIT SHADOWS(LIT)
// A point of a solid: src/scene/solid.rs. Where the ray meets the triangle is found exactly; the rasteriser only says which
// triangles to look at.

#define SOLIDS
#include "shell.glsl"
#include "ray.glsl"
#include "triangle.glsl"
#ifdef LIT
#include "lights.glsl"
#endif

layout(set = 0, binding = 17) uniform sampler3D surface; // one texel along w

layout(location = 0) flat in uint triangle_index;

layout(location = 0) out vec4 out_rgba;
layout(location = 1) out vec4 out_depth; // the first: depth

float along(vec4 row, vec3 point) {
    return dot(row.xyz, point) + row.w;
}

void main() {
    Triangle triangle = triangles[triangle_index];
    vec3 ray = pixel_ray();
    float depth = triangle.plane.w / dot(triangle.plane.xyz, ray);
    if (!(depth >= view.near)) discard; // edge-on
    vec3 point = depth * ray;
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
    out_depth = vec4(depth, 0.0, 0.0, 1.0);
    gl_FragDepth = 1.0 / (1.0 + depth);
}
