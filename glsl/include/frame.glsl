// The shell's local frame along a ray in one tetrahedron: src/shell/frames.rs. World space here has its axes, but its origin at the
// eye, and lengths in parts of `Seen::unit`.

// What a lit scene needs of a tetrahedron beside its `Cell`, in two texels: the frames of its vertices, as bits of whole numbers, and
// 1 / distance of each vertex from the plane of the face opposite.
layout(set = 0, binding = 3) uniform samplerBuffer lit_cells;
// World space from texture space at a vertex: three columns, a texel each.
layout(set = 0, binding = 4) uniform samplerBuffer frames;

// Of the tetrahedron that is being marched, affine in depth, as barycentric coordinates are: `frame_at_eye + z frame_from_depth`.
mat3 frame_at_eye;
mat3 frame_from_depth;
vec3 view_ray; // at unit depth

// Must be called before a point in a tetrahedron is lit.
void enter(uint index, vec4 planes[4], vec3 ray) {
    uvec4 of_vertices = floatBitsToUint(texelFetch(lit_cells, int(2 * index)));
    vec4 per_height = texelFetch(lit_cells, int(2 * index + 1));
    frame_at_eye = mat3(0.0);
    frame_from_depth = mat3(0.0);
    view_ray = ray;
    for (int k = 0; k < 4; k++) {
        int at = int(3 * of_vertices[k]);
        mat3 map = mat3(texelFetch(frames, at).xyz, texelFetch(frames, at + 1).xyz, texelFetch(frames, at + 2).xyz);
        frame_at_eye += map * (-planes[k].w * per_height[k]);
        frame_from_depth += map * (dot(planes[k].xyz, ray) * per_height[k]);
    }
}
