#version 450
#extension GL_ARB_shading_language_include : require
// switches: SPARSE EVEN(SPARSE) SOLIDS
// A pixel of a light's picture: how the medium dims the light along its ray, which walks as the eye's do. What is too much for that is left
// to shadow_left.frag.glsl.

#define LIGHT
#include "shell.glsl"
#include "medium.glsl"
#include "sample.glsl"
#include "picture.glsl"
#include "light_ray.glsl"
#include "dimming.glsl"
#include "walk.glsl"

layout(location = 1) flat in uint picture;

void main() {
    LightPicture light = light_pictures[picture];
    int next;
    int last;
    bool is_begun;
    bool is_left = crossings_of(uvec2(gl_FragCoord.xy - (light.middle - light.half_side)), next, last, is_begun);
    if (is_left) {
        last = next;
        is_begun = false;
    }
    LightRay ray = ray_of(light);
    origin = ray.origin;
    pixel_size = light.pixel;
    is_parallel = light.is_parallel != 0;
    float per_depth = length(ray.along) * light.opacity_distances;
    uint passes = 0;
    Walker walker = walker_at(next, last, is_begun, ray.along, passes);
    while (!walker.strays && passes < MOST_PASSES) {
        Stretch stretch = go_on(walker, ray.along, ray.farthest, passes);
        Steps steps = stretch.steps;
        // It has two ends: see `march_midpoints`.
        for (uint i = stretch.first; i < steps.count || even_waits();) {
            Part part = next_part(steps, i);
            vec4 texel = fetch(stretch.path, part.middle);
#ifdef EVEN
            if (part.is_even) texel = view.even;
#endif
            dim(part.begin, part.size, extinction(texel) * max(part.size * per_depth, LEAST));
            passes += PASSES_A_SAMPLE;
            i = seek(stretch.path, steps, i, passes);
            if (i >= steps.count) break;
        }
        if ((walker.is_done && !even_waits()) || is_dark()) break;
    }
    if (is_left || walker.strays || passes >= MOST_PASSES) discard;
    write_curve();
}
