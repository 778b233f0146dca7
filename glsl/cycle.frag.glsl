#version 450
#extension GL_ARB_shading_language_include : require
// switches: DEPTH SOLIDS LIT SHADOWS(LIT)
// Resolves a cycle of tetrahedra per pixel: no order of them is right for all rays (Kraus and Ertl 2001, who sort the
// members of such a cycle per pixel). Goes from one entry or exit on the ray to the next, with the members that are active
// between the two; where several are (the shell overlaps itself) their media add. A pixel that is too much for that is left to
// the host: it becomes infinite.

#include "shell.glsl"
#include "medium.glsl"
#include "ray.glsl"
#include "sample.glsl"
#include "march.glsl"
#include "solids.glsl"
#include "gather.glsl"
#include "add.glsl"

layout(early_fragment_tests) in; // by mark, where there are any

layout(location = 0) out vec4 out_rgba; // premultiplied
#ifdef DEPTH
layout(location = 1) out vec4 out_depth; // (distance * alpha, 0, 0, alpha)
#endif

void main() {
    vec3 ray = pixel_ray();
#ifdef LIT
    look_along(ray);
#endif
#ifdef SOLIDS
    farthest = solid_depth();
#endif
    float per_depth = length(ray) * view.per_opacity_distance;
    Gathered gathered = Gathered(vec4(0.0), vec4(0.0));
    float mean_distance = 0.0;
    float z = 0.0;
    float horizon;
    bool done = false;
    do {
        uint count = gather(vec3(0.0), ray, z, horizon);
        done = count == 0;
        if (done) break;
        z = max(z, spans[0].x);
        if (z >= horizon) break; // more overlap here than are kept
        uint first = 0;
        while (z < horizon) {
            while (first < count && spans[first].y <= z) first++;
            if (first == count) break;
            // The next entry or exit, and how finely the finest active member wants to be sampled until then.
            float next = horizon;
            uint end = first;
            for (; end < count && spans[end].x <= z; end++) {
                if (spans[end].y > z) next = min(next, spans[end].y);
            }
            if (end < count) next = min(next, spans[end].x);
            uint samples = 0;
            uint present = 0;
            for (uint hit = first; hit < end; hit++) {
                if (spans[hit].y <= z) continue;
                samples = max(samples, sample_count(path_in(cells[hits[hit]].texture, ray), z, next));
                present++;
            }
            passes += AT_ONCE * (end - first + 2) * (samples + 3);
            if (passes > MOST_PASSES) break;
            float step = (next - z) / float(samples); // in a gap there are no samples
            for (uint i = 0; i < samples; i++) {
                float begin = z + float(i) * step;
                Sum sum = nothing();
                float rise = 0.0;
                for (uint hit = first; hit < end; hit++) {
                    if (spans[hit].y <= z) continue;
                    Path path = path_in(cells[hits[hit]].texture, ray);
                    vec4 texel = fetch(path, begin + 0.5 * step);
                    rise = rise_since_last(begin, step, extinction(texel), i == 0 || present > 1);
#ifdef LIT
                    enter(hits[hit], ray);
                    // As if it were alone.
                    float optical = optical_of(texel, step * per_depth);
                    float lit_at = depth_of_step(begin, step, optical, opacity(optical), rise);
                    texel = lit(texel, fetch_from(directions, path, lit_at), lit_at);
#endif
                    add(sum, texel, step * per_depth);
                }
                vec4 mixed = mixture(sum);
#ifdef DEPTH
                float at = depth_of_step(begin, step, optical_of(sum), mixed.a, rise);
                mean_distance += transmittance(gathered) * mixed.a * at * length(ray);
#endif
                lay_behind(gathered, mixed);
            }
            z = next;
        }
        done = horizon >= 3.0e38;
    } while (!done && passes <= MOST_PASSES);
    const float infinity = uintBitsToFloat(0x7f800000u);
    bool left = !done || passes > MOST_PASSES;
    out_rgba = left ? vec4(infinity) : gathered.rgba;
#ifdef DEPTH
    out_depth = left ? vec4(infinity) : vec4(mean_distance, 0.0, 0.0, gathered.rgba.a);
#endif
}
