#version 450
#extension GL_ARB_shading_language_include : require
// switches: DEPTH SOLIDS SPARSE EVEN(SPARSE) LIT SHADOWS(LIT)
// Marches the segment of one ray in one tetrahedron.
// Dufort, Leblanc, Poulin 2005, sections 4.2 and 4.3, with one change: entry and exit are not interpolated over the
// front faces but found per pixel from the four planes, so that the rasteriser's snapping of vertices does not move them.
// An outline that covers a little too much costs a fragment and changes nothing, and an eye inside the tetrahedron is
// no case of its own.

#include "shell.glsl"
#include "medium.glsl"
#include "ray.glsl"
#include "sample.glsl"
#include "march.glsl"
#include "solids.glsl"

layout(location = 0) flat in vec4 planes[4];
layout(location = 4) flat in vec4 texture_rows[3];
#ifdef LIT
layout(location = 7) flat in uint cell_index;
#endif

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
    vec2 segment = interval(planes, ray);
#ifdef SOLIDS
    segment.y = min(segment.y, solid_depth());
#endif
    if (!(segment.y > segment.x)) discard;

#ifdef LIT
    enter(cell_index, ray);
#endif
    Light light = Light(Gathered(vec4(0.0), vec4(0.0)), 0.0);
    march(path_in(texture_rows, ray), segment, length(ray) * view.per_opacity_distance, light);
    out_rgba = light.gathered.rgba;
#ifdef DEPTH
    out_depth = vec4(light.depth * length(ray), 0.0, 0.0, light.gathered.rgba.a);
#endif
}
