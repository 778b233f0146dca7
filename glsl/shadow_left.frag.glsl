#version 450
#extension GL_ARB_shading_language_include : require
// switches: SPARSE SOLIDS
// A pixel of a light's picture that shadow.frag.glsl has left: of a ray that is in several parts of the shell at once, whose media add,
// or that strays. By the same means as cycle.frag.glsl.

#define LIGHT
#include "shell.glsl"
#include "medium.glsl"
#include "ray.glsl"
#include "sample.glsl"
#include "gather.glsl"
#include "picture.glsl"
#include "light_ray.glsl"
#include "dimming.glsl"

layout(location = 1) flat in uint picture;
layout(location = 2) flat in uint coarsely;

const float LONGEST_STEP = 0.5; // `COARSEST_STEP` of src/method/shell/shadows.rs

// Follows the ray to its end, or finds out how many passes its steps `need`; false where that is more than can be resolved.
bool follow(vec3 origin, vec3 ray, bool samples, out uint need) {
    need = 0;
    LightPicture light = light_pictures[picture];
    bool is_parallel = light.is_parallel != 0;
    float per_depth = length(ray) * light.opacity_distances;
    float z = 0.0;
    float horizon;
    bool done = false;
    do {
        uint count = gather(origin, ray, z, horizon);
        done = count == 0;
        if (done) break;
        z = max(z, spans[0].x);
        if (z >= horizon) break; // more overlap here than are kept
        uint first = 0;
        while (z < horizon && !is_dark()) {
            while (first < count && spans[first].y <= z) first++;
            if (first == count) break;
            float next = horizon;
            uint end = first;
            for (; end < count && spans[end].x <= z; end++) {
                if (spans[end].y > z) next = min(next, spans[end].y);
            }
            if (end < count) next = min(next, spans[end].x);
            Steps steps = no_steps();
            uint present = 0;
            Path path; // of the last one, which mostly is the only one: it need not be read again for every sample
            for (uint hit = first; hit < end; hit++) {
                if (spans[hit].y <= z) continue;
                path = path_from(cells[hits[hit]].texture, origin, ray, light.pixel, is_parallel);
                Steps alone = steps_of(path, vec2(z, next));
                if (alone.count > steps.count) steps = alone;
                present++;
            }
            // Of a step: one over samples, one more over members than there are, and those that place knots; where there are none but
            // one, members are not gone through, and what is counted for them is enough for the knots.
            uint a_step = AT_ONCE * (end - first + (present == 1 ? 2 : 3));
            need += a_step * steps.count;
            if (!samples) steps.count = 0;
            passes += a_step * (steps.count + 3);
            if (passes > MOST_PASSES) break;
            // In a gap there are no steps. Looks are fewer than the passes that were counted for the steps.
            bool is_alone = present == 1;
            uint looks = 0;
            // Loops have two ends: see `march_midpoints`.
            for (uint i = is_alone ? seek(path, steps, 0, looks) : 0; i < steps.count;) {
                for (uint taken = 0; i < steps.count;) {
                    float at = middle(steps, i);
                    float of_step = 0.0;
                    if (is_alone) {
                        of_step = extinction(fetch(path, at));
                    } else {
                        for (uint hit = first; hit < end; hit++) {
                            if (spans[hit].y <= z) continue;
                            of_step += extinction(fetch(path_from(cells[hits[hit]].texture, origin, ray, light.pixel, is_parallel), at));
                        }
                    }
                    dim(z + float(i) * steps.size, steps.size, of_step * max(steps.size * per_depth, LEAST));
                    i = is_alone ? seek(path, steps, i + 1, looks) : i + 1;
                    if (i >= steps.count || ++taken == SAMPLES_TOGETHER) break;
                }
                place();
                if (i >= steps.count) break;
            }
            z = next;
        }
        done = horizon >= 3.0e38 || is_dark();
    } while (!done && passes <= MOST_PASSES);
    return done && passes <= MOST_PASSES;
}

void main() {
    LightRay ray = ray_of(light_pictures[picture]);
    farthest = ray.farthest;
    uint need;
    // Where steps are too many, longer ones are taken, but none longer than the shadows of a march of long steps have. To count them
    // takes passes, too: rays for which that is too much are gone through once more, coarsely.
    bool is_counted = coarsely != 0;
    if (is_counted) {
        longer = LONGEST_STEP / view.step;
    } else if (follow(ray.origin, ray.along, false, need)) {
        // All but the steps will be gone through again; and in each stretch, which has taken as much as three steps, one more for rounding.
        uint others = min(passes + passes + passes / 3, MOST_PASSES - 1);
        is_counted = true;
        longer = clamp(float(need) / float(MOST_PASSES - others), 1.0, LONGEST_STEP / view.step);
    }
    bool is_resolved = is_counted && follow(ray.origin, ray.along, true, need);
    // No early fragment tests, which would mark by its depth what is discarded, too.
    if (is_resolved) write_curve();
    else if (coarsely != 0) leave_unresolved();
    else discard;
}
