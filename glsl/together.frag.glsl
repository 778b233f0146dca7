#version 450
#extension GL_ARB_shading_language_include : require
// switches: DEPTH SOLIDS LIT SHADOWS(LIT)
// Walks a ray that is in several parts of the shell at once: a walker in each part. From one entry or exit to the
// next the media of all walkers add. A pixel that is too much for that is left to the host: it becomes infinite.

#include "shell.glsl"
#include "medium.glsl"
#include "ray.glsl"
#include "sample.glsl"
#include "march.glsl"
#include "solids.glsl"
#include "walk.glsl"
#include "add.glsl"

layout(location = 0) out vec4 out_rgba; // premultiplied
#ifdef DEPTH
layout(location = 1) out vec4 out_depth; // (distance * alpha, 0, 0, alpha)
#endif

const uint MOST_WALKERS = 8;
uint places[MOST_WALKERS]; // where each has entered its tetrahedron
uint exits[MOST_WALKERS];  // where it leaves it
float ends[MOST_WALKERS];  // how deep that is
uint walkers = 0;

void begin_at(uint place, vec3 ray) {
    places[walkers] = place;
    exits[walkers] = exit_of(place, ray, ends[walkers]);
    if (exits[walkers] != NOWHERE) walkers++;
}

void main() {
    int next;
    int last;
    entries_of_pixel(true, next, last);
    if (next == last) discard;
    vec3 ray = pixel_ray();
    float per_depth = length(ray) * view.per_opacity_distance;
#ifdef SOLIDS
    float farthest = solid_depth();
#else
    float farthest = FAR;
#endif
    Light light = Light(Gathered(vec4(0.0), vec4(0.0)), 0.0);
    uint passes = 0;
    bool crowded = false;
    float z = view.near;
    while (passes < MOST_PASSES) {
        passes++;
        uint entry = next < last ? texelFetch(entries, next).x : NOWHERE;
        bool leaves = entry != NOWHERE && (entry & LEAVES) != 0;
        float horizon = entry == NOWHERE ? FAR : leaves ? z : depth_at(entry, ray);
        if (walkers == 0) {
            if (entry == NOWHERE) break;
            z = max(z, horizon);
        }
        float stop = min(horizon, farthest);
        for (uint i = 0; i < walkers; i++) stop = min(stop, ends[i]);
        if (stop > z) {
            uint samples = 1;
            for (uint i = 0; i < walkers; i++) {
                vec4 rows[3];
                texture_of(places[i] >> 2, rows);
                samples = max(samples, sample_count(path_in(rows, ray), z, stop));
            }
            passes += samples * (walkers + 1);
            float step = (stop - z) / float(samples);
            for (uint sample_index = 0; sample_index < samples; sample_index++) {
                float at = z + (float(sample_index) + 0.5) * step;
                Sum sum = nothing();
                for (uint i = 0; i < walkers; i++) {
                    vec4 rows[3];
                    texture_of(places[i] >> 2, rows);
#ifdef LIT
                    vec4 planes[4];
                    planes_of(places[i] >> 2, planes);
                    enter(places[i] >> 2, planes, ray);
#endif
                    add(sum, radiant(path_in(rows, ray), at), step * per_depth);
                }
                vec4 mixed = mixture(sum);
                light.depth += transmittance(light.gathered) * mixed.a * at;
                lay_behind(light.gathered, mixed);
            }
            z = stop;
        }
        if (z >= farthest || transmittance(light.gathered) <= SATURATED) break;
        uint i = 0;
        while (i < walkers) {
            if (ends[i] <= z) {
                uint place = texelFetch(beyond, int(exits[i])).x;
                passes++;
                if (place != NOWHERE) {
                    places[i] = place;
                    exits[i] = exit_of(place, ray, ends[i]);
                }
                if (place == NOWHERE || exits[i] == NOWHERE) {
                    walkers--;
                    places[i] = places[walkers];
                    exits[i] = exits[walkers];
                    ends[i] = ends[walkers];
                }
                continue;
            }
            i++;
        }
        if (entry != NOWHERE && horizon <= z) {
            next++;
            crowded = crowded || walkers == MOST_WALKERS;
            if (crowded) break;
            uint place = entry;
            if (INSIDE && leaves) place = back_to_start(entry & ~LEAVES, ray, passes);
            if (place != NOWHERE) begin_at(place, ray);
        }
    }
    bool is_left = crowded || passes >= MOST_PASSES;
    out_rgba = is_left ? vec4(uintBitsToFloat(0x7f800000u)) : light.gathered.rgba;
#ifdef DEPTH
    out_depth = vec4(light.depth * length(ray), 0.0, 0.0, light.gathered.rgba.a);
#endif
}
