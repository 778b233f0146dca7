#version 450
#extension GL_ARB_shading_language_include : require
// variant: shell_depth DEPTH
// Marches one ray segment, from where the ray entered a tetrahedron to where it leaves it (this fragment).
// Dufort, Leblanc, Poulin 2005, sections 4.2 and 4.3, with two changes. Exit faces are drawn instead of entry faces, so
// that an eye inside a tetrahedron needs no case of its own. And the entry is not interpolated but found
// per pixel from interpolated barycentric coordinates, which are exact under perspective: along the ray
// from the exit (s = 0) to the eye (s = 1) a barycentric coordinate runs linearly from b to e, and the ray entered where
// the first of them becomes zero, at s = b / (b - e). No difference of nearly equal lengths is taken.

#include "shell.glsl"
#include "medium.glsl"

layout(constant_id = 0) const bool PAPER_PLAN = false;
layout(constant_id = 1) const bool MINIFIED = true; // whether any level but 0 can be needed

layout(set = 0, binding = 4) uniform sampler3D volume; // premultiplied

layout(location = 0) in vec3 exit_view;
layout(location = 1) in vec3 exit_texture;
layout(location = 2) in vec3 exit_barycentric;
layout(location = 3) flat in vec3 eye_barycentric;
layout(location = 4) flat in vec3 eye_texture;
layout(location = 5) flat in float texels_per_unit;

layout(location = 0) out vec4 out_rgba; // premultiplied
#ifdef DEPTH
layout(location = 1) out vec4 out_depth; // (distance * alpha, 0, 0, alpha)
#endif

float level_of_detail(float depth) {
    return clamp(log2(view.lod_scale * depth * texels_per_unit), 0.0, view.last_level);
}

// Blends two levels by hand: hardware may round the blend's weight to 8 bits.
vec4 fetch(vec3 texture_point, float depth) {
    if (!MINIFIED) return textureLod(volume, texture_point, 0.0);
    float level = level_of_detail(depth);
    float fine = floor(level);
    return mix(textureLod(volume, texture_point, fine), textureLod(volume, texture_point, min(fine + 1.0, view.last_level)),
               level - fine);
}

void main() {
    // The near plane cuts the segment at depth `near`.
    float s_entry = 1.0 - view.near / exit_view.z;
    for (int i = 0; i < 3; i++) {
        float b = max(exit_barycentric[i], 0.0);
        float e = eye_barycentric[i];
        if (e < 0.0) s_entry = min(s_entry, b / (b - e));
    }
    float exit_distance = length(exit_view);
    float segment = exit_distance * s_entry; // world units
    if (!(segment > 0.0)) discard;

    vec3 eye_from_exit_texture = eye_texture - exit_texture;
    uint count = view.samples;
    if (!PAPER_PLAN) {
        float texel = MINIFIED ? exp2(floor(level_of_detail(exit_view.z * (1.0 - 0.5 * s_entry)))) : 1.0;
        float texels = length(eye_from_exit_texture * view.texels) * s_entry / texel;
        count = uint(clamp(ceil(texels / view.step), 1.0, 65536.0));
    }
    float depth_per_alpha = segment / float(count) * view.per_opacity_distance;

    vec4 rgba = vec4(0.0);
    float transmittance = 1.0;
    float mean_distance = 0.0;
    for (uint i = 0; i < count; i++) {
        float s = s_entry * (1.0 - (float(i) + 0.5) / float(count));
        vec4 texel = fetch(exit_texture + s * eye_from_exit_texture, exit_view.z * (1.0 - s));
        float depth = optical_depth(texel.a) * depth_per_alpha;
        float alpha = opacity(depth);
        // Colour is premultiplied by the texture's alpha; what counts is this step's.
        vec3 colour = texel.a > 0.0 ? texel.rgb * (alpha / texel.a) : vec3(0.0);
        rgba += transmittance * vec4(colour, alpha);
#ifdef DEPTH
        mean_distance += transmittance * alpha * exit_distance * (1.0 - s);
#endif
        transmittance *= exp(-depth);
    }
    out_rgba = rgba;
#ifdef DEPTH
    out_depth = vec4(mean_distance, 0.0, 0.0, rgba.a);
#endif
}
