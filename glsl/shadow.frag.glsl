#version 450
#extension GL_ARB_shading_language_include : require
// A pixel of a light's picture: how the medium dims the light along its ray. The order of tetrahedra does not matter to the
// whole, but the curve is made front to back, by the same means as cycle.frag.glsl; where media overlap, they add.
// First the opacity of all is found, then the depths at which equal parts of it are reached.

#define LIGHT
#include "shell.glsl"
#include "medium.glsl"
#include "ray.glsl"
#include "sample.glsl"
#include "gather.glsl"
#include "picture.glsl"
#include "curve.glsl"

layout(location = 1) flat in uint picture;

layout(location = 0) out vec4 out_curve[CURVE_IMAGES];

// Optical depth after which there is no light left for f32.
const float DARK = 17.0;
// The last knot stands where this part of a fall is left: an exponential has no end.
const float LEFT = 0.125;
// Shorter steps than any; keeps an infinite extinction times nothing from being no number.
const float LEAST = 1e-30;

float knots[KNOTS];
uint placed = 0;

// Places the knots that are reached in a step at depth `from`, before which the optical depth is `before`.
void place(float from, float step, float before, float optical, float whole) {
    while (placed < KNOTS) {
        float falls = placed < FALLS ? float(placed) : float(FALLS) - LEFT;
        float wanted = optical_depth(whole * falls / float(FALLS));
        if (wanted > before + optical) break;
        knots[placed++] = from + step * clamp((wanted - before) / optical, 0.0, 1.0);
    }
}

// The optical depth of the ray. Where `placing`, knots are placed, `whole` being the opacity of all.
float follow(vec3 origin, vec3 ray, bool placing, float whole) {
    LightPicture light = light_pictures[picture];
    bool is_parallel = light.is_parallel != 0;
    float per_depth = length(ray) * light.opacity_distances;
    float optical = 0.0;
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
        while (z < horizon && optical < DARK) {
            while (first < count && spans[first].y <= z) first++;
            if (first == count) break;
            float next = horizon;
            uint end = first;
            for (; end < count && spans[end].x <= z; end++) {
                if (spans[end].y > z) next = min(next, spans[end].y);
            }
            if (end < count) next = min(next, spans[end].x);
            uint samples = 0;
            for (uint hit = first; hit < end; hit++) {
                if (spans[hit].y <= z) continue;
                Path path = path_from(cells[hits[hit]].texture, origin, ray, light.pixel, is_parallel);
                samples = max(samples, sample_count(path, z, next));
            }
            passes += AT_ONCE * (end - first + 2) * (samples + 3);
            if (passes > MOST_PASSES) break;
            float step = (next - z) / float(samples); // in a gap there are no samples
            for (uint i = 0; i < samples; i++) {
                float at = z + (float(i) + 0.5) * step;
                float of_step = 0.0;
                for (uint hit = first; hit < end; hit++) {
                    if (spans[hit].y <= z) continue;
                    Path path = path_from(cells[hits[hit]].texture, origin, ray, light.pixel, is_parallel);
                    of_step += extinction(fetch(path, at)) * max(step * per_depth, LEAST);
                }
                if (of_step > 0.0) {
                    if (placing) place(z + float(i) * step, step, optical, of_step, whole);
                    optical += of_step;
                }
            }
            z = next;
        }
        done = horizon >= 3.0e38 || optical >= DARK;
    } while (!done && passes <= MOST_PASSES);
    // Not silently: what is lit by this is then no number either.
    return done && passes <= MOST_PASSES ? optical : uintBitsToFloat(0x7fc00000u);
}

void main() {
    LightPicture light = light_pictures[picture];
    vec2 place = (gl_FragCoord.xy - light.middle) * vec2(light.pixel, -light.pixel);
    vec3 origin = light.is_parallel != 0 ? vec3(place, 0.0) : vec3(0.0);
    vec3 ray = light.is_parallel != 0 ? vec3(0.0, 0.0, 1.0) : vec3(place, 1.0);
    float optical = follow(origin, ray, false, 0.0);
    if (optical == 0.0) discard;
    float whole = min(opacity(optical), 1.0);
    passes = 0;
    follow(origin, ray, true, whole);
    // The last of them may be lost to rounding.
    for (; placed < KNOTS; placed++) knots[placed] = placed > 0 ? knots[placed - 1] : 0.0;
    for (uint i = 0; i < CURVE_IMAGES; i++) {
        for (uint j = 0; j < 4; j++) out_curve[i][j] = i + j == 0 ? whole : knots[4 * i + j - 1];
    }
}
