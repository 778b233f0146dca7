// The shell's local frame along a ray in one tetrahedron: src/shell/frames.rs. World space here has its axes, but its origin at the
// eye, and lengths in parts of `Seen::unit`.

// World space from texture space at a vertex, column by column.
struct Frame {
    vec4 columns[3];
};

// What a lit scene needs of a tetrahedron beside its `Cell`.
struct LitCell {
    uvec4 frames;    // of its vertices
    vec4 per_height; // 1 / distance of each vertex from the plane of the face opposite
};

layout(set = 0, binding = 3, std430) readonly buffer LitCells { LitCell lit_cells[]; }; // as `Cells`
layout(set = 0, binding = 4, std430) readonly buffer Frames { Frame frames[]; };

// Of the tetrahedron that is being marched, affine in depth, as barycentric coordinates are: `frame_at_eye + z frame_from_depth`.
mat3 frame_at_eye;
mat3 frame_from_depth;
vec3 view_ray; // at unit depth

// Must be called before a point in a tetrahedron is lit.
void enter(uint index, vec4 planes[4], vec3 ray) {
    LitCell cell = lit_cells[index];
    frame_at_eye = mat3(0.0);
    frame_from_depth = mat3(0.0);
    view_ray = ray;
    for (int k = 0; k < 4; k++) {
        Frame frame = frames[cell.frames[k]];
        mat3 map = mat3(frame.columns[0].xyz, frame.columns[1].xyz, frame.columns[2].xyz);
        frame_at_eye += map * (-planes[k].w * cell.per_height[k]);
        frame_from_depth += map * (dot(planes[k].xyz, ray) * cell.per_height[k]);
    }
}
