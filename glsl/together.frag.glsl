#version 450
#extension GL_ARB_shading_language_include : require
// switches: DEPTH SOLIDS SPARSE EVEN(SPARSE) LIT SHADOWS(LIT)
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

layout(early_fragment_tests) in; // by mark

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

const uint SHARES_AT_A_TIME = 3; // of what walkers add, before the rays of other pixels go on: see march.glsl

void main() {
    int first;
    int last;
    bool is_begun;
    if (!crossings_of(uvec2(gl_FragCoord.xy), first, last, is_begun)) last = first;
    if (first == last) discard;
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
    uint entry = NOWHERE;
    float horizon = FAR; // where it is entered
    // The way from one entry or exit to the next, in equal steps; which of them, and which walker in it, is next.
    float begin = view.near;
    float stop = view.near;
    uint steps = 0;
    uint step_index = 0;
    uint walker = 0;
    Sum sum = nothing();
#ifdef EVEN
    uint even_walkers = 0; // in the even stretch
#endif
    bool is_done = false;
    while (!is_left && passes < MOST_PASSES) {
        // On to where something may be seen: where several pixels run at once, all of them wait here for one another.
        while (step_index == steps && passes < MOST_PASSES) {
            passes++;
            begin = stop;
            steps = 0;
            step_index = 0;
            before = light;
            uint i = 0;
            while (i < walkers) {
                if (ends[i] <= begin) {
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
            if (entry != NOWHERE && horizon <= begin) {
                next++;
                begin_at(entry, ray);
            }
            entry = NOWHERE;
            while (entry == NOWHERE && next < last) {
                uint crossing = texelFetch(crossings, next).x;
                if ((crossing & LEAVES) != 0) next++;
                else entry = crossing;
            }
            horizon = FAR;
            if (entry != NOWHERE && !enters(faces_at(entry, ray), ray, horizon)) is_left = true;
            is_done = begin >= farthest || (walkers == 0 && entry == NOWHERE);
            if (is_done || is_left || (walkers == 0 && even_waits())) break;
            if (walkers == 0) {
                stop = max(begin, horizon);
                continue;
            }
            stop = min(horizon, farthest);
            for (uint i = 0; i < walkers; i++) stop = min(stop, ends[i]);
            if (!(stop > begin)) {
                stop = begin;
                continue;
            }
            steps = 1;
            bool is_even = true;
            for (uint i = 0; i < walkers; i++) {
                Path path = path_of(places[i] >> 2, ray);
#ifdef EVEN
                Steps alone = steps_of(path, vec2(begin, stop));
                is_even = is_even && are_even(path, alone);
                steps = max(steps, alone.count);
#else
                steps = max(steps, sample_count(path, begin, stop));
#endif
            }
            passes += walkers;
#ifdef EVEN
            // Of as many walkers all along: else its light would not come from where it is said to.
            is_even = is_even && (!even_waits() || even_walkers == walkers);
            if (is_even && steps <= view.even_steps - even.steps) {
                even_walkers = walkers;
                pass_evenly(begin, stop, steps);
                steps = 0;
                if (even_is_full()) break;
            } else if (is_even) {
                steps = (steps + view.even_steps - 1) / view.even_steps;
            }
#endif
        }
        for (uint taken = 0; step_index < steps || even_waits();) {
            // What one walker adds to a step, or all that was even.
            uint cell = places[walker] >> 2;
            float size = (stop - begin) / float(max(steps, 1u));
            float step_begin = begin + float(step_index) * size;
            Path path = path_of(cell, ray);
            vec4 texel = fetch(path, step_begin + 0.5 * size);
            // Of what this walker passes, which is lit as if it were alone.
            float optical = optical_of(texel, size * per_depth);
            bool is_even = even_waits();
#ifdef EVEN
            if (is_even) {
                texel = view.even;
                step_begin = even.begin;
                size = even.end - even.begin;
                optical = optical_of(texel, float(even_walkers) * size * per_depth);
            }
#endif
            float alpha = opacity(optical);
            float rise = rise_since_last(step_begin, size, extinction(texel), step_index == 0 || is_even || walkers > 1);
            float z = depth_of_step(step_begin, size, optical, alpha, rise);
#ifdef LIT
            enter(cell, ray);
            texel = lit(texel, is_even ? vec4(0.0) : fetch_from(directions, path, z), z);
#endif
            vec4 mixed = vec4(0.0);
#ifdef EVEN
            if (is_even) {
                mixed = vec4(emitted(texel, alpha), alpha);
                even.steps = 0;
            }
#endif
            if (!is_even) {
                add(sum, texel, size * per_depth);
                walker++;
                if (walker == walkers) {
                    mixed = mixture(sum);
                    z = depth_of_step(step_begin, size, optical_of(sum), mixed.a, rise);
                    sum = nothing();
                    walker = 0;
                    step_index++;
                }
            }
            light.depth += transmittance(light.gathered) * mixed.a * z;
            lay_behind(light.gathered, mixed);
            passes += PASSES_A_SAMPLE;
            if (++taken == SHARES_AT_A_TIME || (step_index == steps && !even_waits()) || is_saturated(light)) break;
        }
        if ((is_done && !even_waits()) || is_saturated(light)) break;
    }
    // Else all of it was looked at: what is behind is no medium.
    bool goes_on = entry != NOWHERE;
    for (uint i = 0; i < walkers; i++) {
        goes_on = goes_on || ends[i] > stop || texelFetch(beyond, int(exits[i])).x != NOWHERE;
    }
    if (step_index < steps || even_waits() || (goes_on && stop < farthest)) fill_up(light, before);
    is_left = is_left || passes >= MOST_PASSES;
    out_rgba = is_left ? vec4(uintBitsToFloat(0x7f800000u)) : light.gathered.rgba;
#ifdef DEPTH
    out_depth = vec4(light.depth * length(ray), 0.0, 0.0, light.gathered.rgba.a);
#endif
}
