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

const uint MOST_WALKERS = 16;
uint places[MOST_WALKERS]; // where each has entered its tetrahedron
uint exits[MOST_WALKERS];  // where it leaves it
float ends[MOST_WALKERS];  // how deep that is
uint walkers = 0;
// Whether the host must see to this pixel.
bool is_left = false;

void begin_at(uint place, vec3 ray) {
    if (walkers == MOST_WALKERS) {
        is_left = true;
        return;
    }
    places[walkers] = place;
    exits[walkers] = exit_of(faces_at(place, ray), ends[walkers]);
    if (exits[walkers] != NOWHERE) walkers++;
    else is_left = true;
}

// Whether a ray leaves the shell by `exit`, or as deep by another face.
bool leaves_by(uint exit, float depth, int first, int last, vec3 ray) {
    for (int i = first; i < last; i++) {
        uint crossing = texelFetch(crossings, i).x;
        if ((crossing & LEAVES) == 0) continue;
        uint leave = crossing & ~LEAVES;
        vec4 face = plane_at(leave);
        float towards_inside = dot(face.xyz, ray);
        bool is_near = abs(face.w / towards_inside - depth) <= STRAY * depth;
        if (-towards_inside > FLAT * length(ray) && (exit == leave || is_near)) return true;
    }
    return false;
}

void main() {
    int first;
    int last;
    bool is_begun;
    if (!crossings_of(uvec2(gl_FragCoord.xy), first, last, is_begun)) last = first;
    if (first == last) discard;
    vec3 ray = pixel_ray();
    float per_depth = length(ray) * view.per_opacity_distance;
#ifdef SOLIDS
    float farthest = solid_depth();
#else
    float farthest = FAR;
#endif
    Light light = Light(Gathered(vec4(0.0), vec4(0.0)), 0.0);
    uint passes = 0;
    float z = view.near;
    if (is_begun) {
        // Any of the parts that it leaves may be one that it begins in: as many as it leaves more often than it enters.
        int begun = 0;
        for (int i = first; i < last; i++) {
            uint leave = texelFetch(crossings, i).x;
            if ((leave & LEAVES) == 0) {
                begun--;
                continue;
            }
            begun++;
            uint place = back_to_start(leave & ~LEAVES, ray, passes);
            if (place != NOWHERE) begin_at(place, ray);
        }
        is_left = is_left || int(walkers) < begun;
    }
    int next = first;
    while (!is_left && passes < MOST_PASSES) {
        passes++;
        uint entry = NOWHERE;
        while (entry == NOWHERE && next < last) {
            uint crossing = texelFetch(crossings, next).x;
            if ((crossing & LEAVES) != 0) next++;
            else entry = crossing;
        }
        float horizon = FAR;
        if (entry != NOWHERE && !enters(faces_at(entry, ray), ray, horizon)) is_left = true;
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
            passes += samples * (walkers * PASSES_A_SAMPLE + 1);
            float step = (stop - z) / float(samples);
            for (uint sample_index = 0; sample_index < samples; sample_index++) {
                float at = z + (float(sample_index) + 0.5) * step;
                Sum sum = nothing();
                for (uint i = 0; i < walkers; i++) {
                    vec4 rows[3];
                    texture_of(places[i] >> 2, rows);
#ifdef LIT
                    enter(places[i] >> 2, ray);
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
                if (place == NOWHERE) {
                    passes += uint(last - first);
                    is_left = is_left || !leaves_by(exits[i], ends[i], first, last, ray);
                }
                if (place != NOWHERE) {
                    places[i] = place;
                    exits[i] = exit_of(faces_at(place, ray), ends[i]);
                }
                if (place == NOWHERE || exits[i] == NOWHERE) {
                    is_left = is_left || place != NOWHERE;
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
            begin_at(entry, ray);
        }
    }
    is_left = is_left || passes >= MOST_PASSES;
    out_rgba = is_left ? vec4(uintBitsToFloat(0x7f800000u)) : light.gathered.rgba;
#ifdef DEPTH
    out_depth = vec4(light.depth * length(ray), 0.0, 0.0, light.gathered.rgba.a);
#endif
}
