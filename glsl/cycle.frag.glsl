#version 450
#extension GL_ARB_shading_language_include : require
// variant: cycle_depth DEPTH
// Resolves a cycle of tetrahedra per pixel: no order of them is right for all rays (Kraus and Ertl 2001, who sort the
// members of such a cycle per pixel). Goes from one entry or exit on the ray to the next, with the members that are active
// between the two; where several are (the shell overlaps itself) their media add.

#include "shell.glsl"
#include "medium.glsl"
#include "ray.glsl"
#include "sample.glsl"

layout(set = 0, binding = 0, std430) readonly buffer Cells { Cell cells[]; };

layout(location = 0) flat in uvec2 members; // first, end

layout(location = 0) out vec4 out_rgba; // premultiplied
#ifdef DEPTH
layout(location = 1) out vec4 out_depth; // (distance * alpha, 0, 0, alpha)
#endif

// Those that the ray meets; where there are more, every member is looked at each time.
const uint MOST_HITS = 64;
uint hits[MOST_HITS];

void main() {
    vec3 ray = pixel_ray();
    uint hit_count = 0;
    float z = 3.0e38;
    for (uint cell = members.x; cell < members.y; cell++) {
        vec2 segment = interval(cells[cell].planes, ray);
        if (!(segment.y > segment.x)) continue;
        if (hit_count < MOST_HITS) hits[hit_count] = cell;
        hit_count++;
        z = min(z, segment.x);
    }
    if (hit_count == 0) discard;
    bool listed = hit_count <= MOST_HITS;
    uint looks = listed ? hit_count : members.y - members.x;

    float per_depth = length(ray) * view.per_opacity_distance;
    vec4 rgba = vec4(0.0);
    float transmittance = 1.0;
    float mean_distance = 0.0;
    while (z < 3.0e38) {
        // The next entry or exit, and how finely the finest active member wants to be sampled until then.
        float next = 3.0e38;
        for (uint look = 0; look < looks; look++) {
            vec2 segment = interval(cells[listed ? hits[look] : members.x + look].planes, ray);
            if (!(segment.y > segment.x)) continue;
            if (segment.x > z) next = min(next, segment.x);
            if (segment.y > z) next = min(next, segment.y);
        }
        if (next == 3.0e38) break;
        uint count = 0;
        for (uint look = 0; look < looks; look++) {
            uint cell = listed ? hits[look] : members.x + look;
            vec2 segment = interval(cells[cell].planes, ray);
            if (segment.x <= z && segment.y > z) count = max(count, sample_count(path_in(cells[cell].texture, ray), z, next));
        }
        float step = (next - z) / float(count); // count is 0 in a gap: no sample
        for (uint i = 0; i < count; i++) {
            float at = z + (float(i) + 0.5) * step;
            float depth = 0.0;
            vec3 emitted = vec3(0.0); // sum of straight colour times optical depth
            uint walls = 0;
            vec3 wall = vec3(0.0);
            for (uint look = 0; look < looks; look++) {
                uint cell = listed ? hits[look] : members.x + look;
                vec2 segment = interval(cells[cell].planes, ray);
                if (!(segment.x <= z && segment.y > z)) continue;
                vec4 texel = fetch(path_in(cells[cell].texture, ray), at);
                if (texel.a >= 1.0) {
                    walls++;
                    wall += texel.rgb;
                } else if (texel.a > 0.0) {
                    float one = optical_depth(texel.a) * step * per_depth;
                    depth += one;
                    emitted += texel.rgb * (one / texel.a);
                }
            }
            float alpha = walls > 0 ? 1.0 : opacity(depth);
            vec3 colour = walls > 0 ? wall / float(walls) : depth > 0.0 ? emitted * (alpha / depth) : vec3(0.0);
            rgba += transmittance * vec4(colour, alpha);
#ifdef DEPTH
            mean_distance += transmittance * alpha * at * length(ray);
#endif
            transmittance *= walls > 0 ? 0.0 : exp(-depth);
        }
        z = next;
    }
    out_rgba = rgba;
#ifdef DEPTH
    out_depth = vec4(mean_distance, 0.0, 0.0, rgba.a);
#endif
}
