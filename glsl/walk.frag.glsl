#version 450
#extension GL_ARB_shading_language_include : require
// switches: DEPTH SOLIDS SPARSE LIT SHADOWS(LIT)
// Walks the ray of each pixel through the shell, front to back, from every place where it enters. A pixel that is too much for
// that is left to the host: it becomes infinite.

#include "shell.glsl"
#include "medium.glsl"
#include "ray.glsl"
#include "sample.glsl"
#include "march.glsl"
#include "solids.glsl"
#include "walk.glsl"

layout(location = 0) out vec4 out_rgba; // premultiplied
#ifdef DEPTH
layout(location = 1) out vec4 out_depth; // (distance * alpha, 0, 0, alpha)
#endif

void main() {
    int next;
    int last;
    bool is_begun;
    crossings_of_pixel(false, next, last, is_begun);
    if (next == last) discard;
    vec3 ray = pixel_ray();
    float per_depth = length(ray) * view.per_opacity_distance;
#ifdef SOLIDS
    float farthest = solid_depth();
#else
    float farthest = FAR;
#endif
    Light light = Light(Gathered(vec4(0.0), vec4(0.0)), 0.0);
    uint place = NOWHERE;
    float from = view.near;
    uint passes = 0;
    bool strays = false;
    if (is_begun) {
        place = back_to_start(texelFetch(crossings, next).x & ~LEAVES, ray, passes);
        strays = place == NOWHERE;
    }
    // Of the tetrahedron that the ray is in.
    uint cell = 0;
    Path path = Path(vec3(0.0), vec3(0.0), 0.0);
    Steps steps = no_steps();
    uint first = 0;
    bool is_done = false;
    while (!strays && passes < MOST_PASSES) {
        // On to the next in which something may be seen. Where several pixels run at once, all of them wait here for one another, and
        // march together then.
        while (passes < MOST_PASSES) {
            passes++;
            first = 0;
            steps.count = 0;
            bool is_outside = place == NOWHERE;
            if (is_outside) {
                is_done = next == last;
                if (is_done) break;
                uint crossing = texelFetch(crossings, next++).x;
                if ((crossing & LEAVES) != 0) continue;
                place = crossing;
            }
            cell = place >> 2;
            // Of all tetrahedra alike, also where the ray goes on: to lavapipe a branch saves nothing, so that what is read here is read
            // once for both.
            Faces faces = faces_at(place, ray);
            if (is_outside) {
                float depth;
                strays = strays || !enters(faces, ray, depth);
                from = max(from, depth);
            }
            float depth;
            uint exit = exit_of(faces, depth);
            vec2 segment = vec2(from, min(depth, farthest));
            if (exit != NOWHERE && segment.y > segment.x) {
                vec4 rows[3];
                texture_of(cell, rows);
                path = path_in(rows, ray);
                steps = steps_of(path, segment);
                first = seek(path, steps, 0, passes);
                from = segment.y;
            }
            is_done = from >= farthest;
            place = exit == NOWHERE || is_done ? NOWHERE : texelFetch(beyond, int(exit)).x;
            if (place == NOWHERE && !is_done && next < last) {
                uint leave = texelFetch(crossings, next).x;
                if ((leave & LEAVES) != 0) {
                    next++;
                    strays = strays || !leaves(from, exit, leave & ~LEAVES, ray);
                }
            }
            if (first < steps.count || is_done || strays) break;
        }
        if (first < steps.count) {
#ifdef LIT
            enter(cell, ray);
#endif
            march_midpoints(path, steps, first, per_depth, light, passes);
        }
        if (is_done || transmittance(light.gathered) <= SATURATED) break;
    }
    bool is_left = strays || passes >= MOST_PASSES;
    out_rgba = is_left ? vec4(uintBitsToFloat(0x7f800000u)) : light.gathered.rgba;
#ifdef DEPTH
    out_depth = vec4(light.depth * length(ray), 0.0, 0.0, light.gathered.rgba.a);
#endif
}
