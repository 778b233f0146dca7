#version 450
#extension GL_ARB_shading_language_include : require
// switches: SPARSE
// A pixel of a light's picture: how the medium dims the light along its ray. The order of tetrahedra does not matter to the
// whole, but the curve is made front to back, by the same means as cycle.frag.glsl; where media overlap, they add.
// Knots are placed as the opacity grows; once there are too many, every other one is left out.

#define LIGHT
#include "shell.glsl"
#include "medium.glsl"
#include "ray.glsl"
#include "sample.glsl"
#include "gather.glsl"
#include "picture.glsl"
#include "curve.glsl"

layout(location = 1) flat in uint picture;

layout(location = 0) out vec4 out_curve[CURVE_LAYERS];

// Optical depth after which what is left of the light does not count: a thousandth.
const float DARK = 7.0;
// An exponential has no end: from the last knot that an opaque ray has, 1 - 1 / GROWTHS, the line goes to where this part of the
// rest is left.
const float LEFT = 0.125;
// Shorter steps than any; keeps an infinite extinction times nothing from being no number.
const float LEAST = 1e-30;

float knots[KNOTS];
uint placed = 0;
float growth = LEAST_GROWTH;
float doublings = 0.0; // of the growth
float all_but_dark = 3.0e38; // the depth at which LEFT is left

// Where in a step of an optical depth, after another one, that one is reached.
float reach(float wanted, float before, float optical, float from, float step) {
    return from + step * clamp((wanted - before) / optical, 0.0, 1.0);
}

// Leaves out every other knot.
void thin_out() {
    for (uint i = 0; i < KNOTS / 2; i++) knots[i] = knots[2 * i];
    placed = (placed + 1) / 2;
    growth *= 2.0;
    doublings += 1.0;
}

// Places the knots that are reached in a step at depth `from`, before which the optical depth is `before`.
void place(float from, float step, float before, float optical) {
    float now = before + optical;
    float grown = min(opacity(now), 1.0);
    while (grown >= growth * float(KNOTS)) thin_out();
    for (; float(placed) * growth <= grown && placed < KNOTS; placed++) {
        knots[placed] = reach(optical_depth(float(placed) * growth), before, optical, from, step);
    }
    float nearly = optical_depth(1.0 - LEFT / float(GROWTHS));
    if (now >= nearly && all_but_dark >= 3.0e38) all_but_dark = reach(nearly, before, optical, from, step);
}

// The optical depth of the ray, and where it ends; false where that is more than can be resolved.
bool follow(vec3 origin, vec3 ray, out float optical, out float end_depth) {
    LightPicture light = light_pictures[picture];
    bool is_parallel = light.is_parallel != 0;
    float per_depth = length(ray) * light.opacity_distances;
    optical = 0.0;
    float z = 0.0;
    float horizon;
    end_depth = 0.0;
    bool done = false;
    do {
        uint count = gather(origin, ray, z, horizon);
        done = count == 0;
        if (done) break;
        z = max(z, spans[0].x);
        if (z >= horizon) break; // more overlap here than are kept
        uint first = 0;
        while (z < horizon && optical < DARK) {
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
            passes += AT_ONCE * (end - first + 2) * (steps.count + 3);
            if (passes > MOST_PASSES) break;
            // In a gap there are no steps. Looks are fewer than the passes that were counted for the steps.
            bool is_alone = present == 1;
            uint looks = 0;
            for (uint i = is_alone ? seek(path, steps, 0, looks) : 0; i < steps.count;) {
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
                of_step *= max(steps.size * per_depth, LEAST);
                if (of_step > 0.0) {
                    place(z + float(i) * steps.size, steps.size, optical, of_step);
                    optical += of_step;
                    end_depth = z + float(i + 1) * steps.size;
                }
                i = is_alone ? seek(path, steps, i + 1, looks) : i + 1;
            }
            z = next;
        }
        done = horizon >= 3.0e38 || optical >= DARK;
    } while (!done && passes <= MOST_PASSES);
    return done && passes <= MOST_PASSES;
}

void main() {
    LightPicture light = light_pictures[picture];
    vec2 place = (gl_FragCoord.xy - light.middle) * vec2(light.pixel, -light.pixel);
    vec3 origin = light.is_parallel != 0 ? vec3(place, 0.0) : vec3(0.0);
    vec3 ray = light.is_parallel != 0 ? vec3(0.0, 0.0, 1.0) : vec3(place, 1.0);
    float optical, end;
    if (!follow(origin, ray, optical, end)) {
        for (uint i = 0; i < CURVE_LAYERS; i++) out_curve[i] = vec4(UNRESOLVED);
        return;
    }
    if (optical == 0.0) discard;
    float whole = min(opacity(optical), 1.0);
    end = min(end, all_but_dark);
    // A line through the last knot that reaches the opacity of all at the end; beyond, there are none.
    if (placed == KNOTS) thin_out();
    float last = knots[placed - 1];
    float rest = whole - float(placed - 1) * growth;
    knots[placed] = rest > 0.0 ? last + (end - last) * growth / rest : last;
    for (uint i = placed + 1; i < KNOTS; i++) knots[i] = 3.0e38;
    out_curve[0] = vec4(2.0 * doublings + whole, knots[4], knots[8], knots[12]);
    for (uint i = 0; i < PARTS; i++) out_curve[1 + i] = vec4(knots[4 * i], knots[4 * i + 1], knots[4 * i + 2], knots[4 * i + 3]);
}
