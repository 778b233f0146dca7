#version 450
#extension GL_ARB_shading_language_include : require
// variant: shell_depth DEPTH
// Marches the segment of one ray in one tetrahedron.
// Dufort, Leblanc, Poulin 2005, sections 4.2 and 4.3, with one change: entry and exit are not interpolated over the
// front faces but found per pixel from the four planes (Cyrus-Beck clipping), so that the rasteriser's snapping of vertices
// does not move them. Two cells that share a face hold the same plane, negated: one leaves at the very depth, bit for bit,
// at which the other is entered. An outline that covers a little too much costs a fragment and changes nothing, and an
// eye inside the tetrahedron is no case of its own.

#include "shell.glsl"
#include "medium.glsl"

layout(constant_id = 0) const bool PAPER_PLAN = false;
layout(constant_id = 1) const bool MINIFIED = true; // whether any level but 0 can be needed

layout(set = 0, binding = 1) uniform sampler3D volume; // premultiplied

layout(location = 0) flat in vec4 planes[4];
layout(location = 4) flat in vec4 texture_rows[3];

layout(location = 0) out vec4 out_rgba; // premultiplied
#ifdef DEPTH
layout(location = 1) out vec4 out_depth; // (distance * alpha, 0, 0, alpha)
#endif

// `detail` is the footprint of the pixel at depth 1 in level-0 texels.
float level_of_detail(float depth, float detail) {
    return clamp(log2(depth * detail), 0.0, view.last_level);
}

// Blends two levels by hand: hardware may round the blend's weight to 8 bits.
vec4 fetch(vec3 texture_point, float depth, float detail) {
    if (!MINIFIED) return textureLod(volume, texture_point, 0.0);
    float level = level_of_detail(depth, detail);
    float fine = floor(level);
    return mix(textureLod(volume, texture_point, fine), textureLod(volume, texture_point, min(fine + 1.0, view.last_level)),
               level - fine);
}

void main() {
    // The ray, at depth 1; image rows run down.
    vec3 ray = vec3((gl_FragCoord.xy - view.centre) * vec2(view.pixel, -view.pixel), 1.0);
    float entry = view.near; // depths
    float exit = 3.0e38;
    for (int i = 0; i < 4; i++) {
        float towards_inside = dot(planes[i].xyz, ray);
        float depth = planes[i].w / towards_inside;
        if (towards_inside > 0.0) entry = max(entry, depth);
        else if (towards_inside < 0.0) exit = min(exit, depth);
        else if (planes[i].w > 0.0) exit = entry; // parallel to the face, and outside
    }
    if (!(exit > entry)) discard;

    float ray_length = length(ray);
    vec3 texture_from_depth = vec3(dot(texture_rows[0].xyz, ray), dot(texture_rows[1].xyz, ray), dot(texture_rows[2].xyz, ray));
    vec3 texture_at_eye = vec3(texture_rows[0].w, texture_rows[1].w, texture_rows[2].w);
    // Texels across the ray: the pixel has no width along it.
    vec3 across = view.texels * vec3(length(cross(texture_rows[0].xyz, ray)), length(cross(texture_rows[1].xyz, ray)),
                                     length(cross(texture_rows[2].xyz, ray)));
    float detail = view.lod_scale * max(across.x, max(across.y, across.z)) / ray_length;
    uint count = view.samples;
    if (!PAPER_PLAN) {
        float texel = MINIFIED ? exp2(floor(level_of_detail(0.5 * (entry + exit), detail))) : 1.0;
        float texels = length(texture_from_depth * view.texels) * (exit - entry) / texel;
        count = uint(clamp(ceil(texels / view.step), 1.0, 65536.0));
    }
    float step = (exit - entry) / float(count);
    float depth_per_alpha = step * ray_length * view.per_opacity_distance;

    vec4 rgba = vec4(0.0);
    float transmittance = 1.0;
    float mean_distance = 0.0;
    for (uint i = 0; i < count; i++) {
        float z = entry + (float(i) + 0.5) * step;
        vec4 texel = fetch(texture_at_eye + z * texture_from_depth, z, detail);
        float depth = optical_depth(texel.a) * depth_per_alpha;
        float alpha = opacity(depth);
        // Colour is premultiplied by the texture's alpha; what counts is this step's.
        vec3 colour = texel.a > 0.0 ? texel.rgb * (alpha / texel.a) : vec3(0.0);
        rgba += transmittance * vec4(colour, alpha);
#ifdef DEPTH
        mean_distance += transmittance * alpha * z * ray_length;
#endif
        transmittance *= exp(-depth);
    }
    out_rgba = rgba;
#ifdef DEPTH
    out_depth = vec4(mean_distance, 0.0, 0.0, rgba.a);
#endif
}
