// The shell's local frame along a ray in one tetrahedron: src/shell/frames.rs. World space here has its axes, but its origin at the
// eye, and lengths in parts of `Seen::unit`.

// World space from texture space: three columns of three entries, nine texels a tetrahedron. Each is affine in the point, in view
// space: dot(entry.xyz, point) + entry.w.
layout(set = 0, binding = 3) uniform samplerBuffer frames;

// Of the tetrahedron that is being marched, affine in depth: `frame_at_eye + z frame_from_depth`.
mat3 frame_at_eye;
mat3 frame_from_depth;

// Must be called before a point in a tetrahedron is lit.
void enter(uint index, vec3 ray) {
    for (int column = 0; column < 3; column++) {
        for (int row = 0; row < 3; row++) {
            vec4 entry = texelFetch(frames, int(9 * index) + 3 * column + row);
            frame_at_eye[column][row] = entry.w;
            frame_from_depth[column][row] = dot(entry.xyz, ray);
        }
    }
}
