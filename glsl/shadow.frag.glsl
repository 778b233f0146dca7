#version 450
#extension GL_ARB_shading_language_include : require
// switches: SPARSE SOLIDS
// A pixel of a light's picture: how the medium dims the light along its ray, which walks as the eye's do. What is too much for that is left
// to shadow_left.frag.glsl.

#define LIGHT
#include "shell.glsl"
#include "medium.glsl"
#include "sample.glsl"
#include "picture.glsl"
#include "blocked.glsl"
#include "walk.glsl"
#include "dimming.glsl"

layout(location = 1) flat in uint picture;

// Of lavapipe through loops, for a sample: those over samples and over knots.
const uint PASSES_A_SAMPLE = 3;

void main() {
    LightPicture light = light_pictures[picture];
    int next;
    int last;
    bool is_begun;
    bool is_left = crossings_of(uvec2(gl_FragCoord.xy - (light.middle - light.half_side)), next, last, is_begun);
    // Without crossings a ray that is left soon stops, should it run on with those of neighbouring pixels.
    if (is_left) last = next;
    vec2 place = (gl_FragCoord.xy - light.middle) * vec2(light.pixel, -light.pixel);
    is_parallel = light.is_parallel != 0;
    pixel_size = light.pixel;
    origin = is_parallel ? vec3(place, 0.0) : vec3(0.0);
    vec3 ray = is_parallel ? vec3(0.0, 0.0, 1.0) : vec3(place, 1.0);
    float per_depth = length(ray) * light.opacity_distances;
    float farthest = blocked_from(gl_FragCoord.xy - light.middle, is_parallel);
    uint passes = 0;
    Walker walker = walker_at(next, last, is_begun, ray, passes);
    while (!walker.strays && passes < MOST_PASSES) {
        Stretch stretch = go_on(walker, ray, farthest, passes);
        Steps steps = stretch.steps;
        // It has two ends: see `march_midpoints`.
        for (uint i = stretch.first; i < steps.count;) {
            float of_step = extinction(fetch(stretch.path, middle(steps, i))) * max(steps.size * per_depth, LEAST);
            dim(steps.begin + float(i) * steps.size, steps.size, of_step);
            passes += PASSES_A_SAMPLE;
            i = seek(stretch.path, steps, i + 1, passes);
            if (i >= steps.count) break;
        }
        if (walker.is_done || is_dark()) break;
    }
    if (is_left || walker.strays || passes >= MOST_PASSES) discard;
    write_curve();
}
