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
    Stretch stretch = nothing_passed();
    while (!walker.strays && passes < MOST_PASSES) {
        if (stretch.first >= stretch.steps.count) stretch = go_on(walker, ray.along, ray.farthest, passes);
        Steps steps = stretch.steps;
        uint taken = 0; // samples, before other pixels' rays go on: see march.glsl
        // It has two ends: see `march_midpoints`.
        for (; stretch.first < steps.count || even_waits();) {
            Part part = next_part(steps, stretch.first);
            vec4 texel = fetch(stretch.path, part.middle);
#ifdef EVEN
            if (part.is_even) texel = view.even;
#endif
            dim(part.begin, part.size, extinction(texel) * max(part.size * per_depth, LEAST));
            passes += PASSES_A_SAMPLE;
            stretch.first = seek(stretch.path, steps, stretch.first, passes);
            if (stretch.first >= steps.count || ++taken == SAMPLES_TOGETHER || is_dark()) break;
        }
        place();
        if ((walker.is_done && stretch.first >= steps.count && !even_waits()) || is_dark()) break;
    }
    if (is_left || walker.strays || passes >= MOST_PASSES) discard;
    write_curve();
}
