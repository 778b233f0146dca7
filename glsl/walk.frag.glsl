#version 450
#extension GL_ARB_shading_language_include : require
// switches: DEPTH SOLIDS SPARSE EVEN(SPARSE) LIT SHADOWS(LIT)
// Walks the ray of each pixel through the shell, front to back, from every place where it enters. A pixel that is too much for
// that is left to the host: it becomes infinite.

#define WALKS
#include "shell.glsl"
#include "medium.glsl"
#include "ray.glsl"
#include "sample.glsl"
#include "march.glsl"
#include "solids.glsl"
#include "walk.glsl"

layout(early_fragment_tests) in; // by mark

layout(location = 0) out vec4 out_rgba; // premultiplied
#ifdef DEPTH
layout(location = 1) out vec4 out_depth; // (distance * alpha, 0, 0, alpha)
#endif

void main() {
    int next;
    int last;
    bool is_begun;
    bool is_intricate = crossings_of(uvec2(gl_FragCoord.xy), next, last, is_begun);
    if (is_intricate) last = next;
    if (next == last) discard;
    vec3 ray = pixel_ray();
#ifdef LIT
    look_along(ray);
#endif
    float per_depth = length(ray) * view.per_opacity_distance;
#ifdef SOLIDS
    float farthest = solid_depth();
#else
    float farthest = FAR;
#endif
    Light light = Light(Gathered(vec4(0.0), vec4(0.0)), 0.0);
    Light before = light; // before the stretch that was looked at last
    uint passes = 0;
    Walker walker = walker_at(next, last, is_begun, ray, passes);
#ifdef FEW_AT_A_TIME
    Stretch stretch = nothing_passed();
#endif
    while (!walker.strays && passes < MOST_PASSES) {
#ifdef FEW_AT_A_TIME
        if (stretch.first >= stretch.steps.count) {
            stretch = go_on(walker, ray, farthest, passes);
            before = light;
        }
#else
        Stretch stretch = go_on(walker, ray, farthest, passes);
        before = light;
#endif
        bool is_passed = true;
        if (stretch.first < stretch.steps.count || even_waits()) {
#ifdef LIT
            enter(stretch.cell, ray);
#endif
            uint i = stretch.first;
            march_midpoints(stretch.path, stretch.steps, i, per_depth, light, passes);
#ifdef FEW_AT_A_TIME
            stretch.first = i;
            is_passed = i >= stretch.steps.count;
#endif
        }
        if ((walker.is_done && is_passed && !even_waits()) || is_saturated(light)) break;
    }
    // Else all of it was looked at: what is behind is no medium.
    bool is_cut = !walker.is_done && (walker.place != NOWHERE || walker.next != walker.last);
#ifdef FEW_AT_A_TIME
    is_cut = is_cut || stretch.first < stretch.steps.count;
#endif
    if (is_cut || even_waits()) fill_up(light, before);
    bool is_left = walker.strays || passes >= MOST_PASSES;
    out_rgba = is_left ? vec4(uintBitsToFloat(0x7f800000u)) : light.gathered.rgba;
#ifdef DEPTH
    out_depth = vec4(light.depth * length(ray), 0.0, 0.0, light.gathered.rgba.a);
#endif
}
