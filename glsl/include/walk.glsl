// From tetrahedron to tetrahedron along a ray (M. Garrity, Raytracing irregular volume data, 1990): out of each by the face
// that the ray meets first, into the neighbour there. What is fetched is small and far apart, for which texels are made.

layout(set = 0, binding = 18) uniform samplerBuffer cells;    // of src/method/shell/seen.rs, nine texels each
layout(set = 0, binding = 19) uniform usamplerBuffer beyond;  // four a tetrahedron: the place beyond each face, or NOWHERE
layout(set = 0, binding = 20) uniform usamplerBuffer firsts;  // of each pixel, row by row, in `entries`; and after the last
layout(set = 0, binding = 21) uniform usamplerBuffer entries; // places where rays enter the shell, front to back

// A place is four times a tetrahedron and the number of its face.
const uint NOWHERE = 0xffffffffu;
// In `entries`: the ray may have begun in the shell; here it leaves it.
const uint LEAVES = 0x80000000u;

const float FAR = 3.0e38;

vec4 plane_at(uint place) {
    return texelFetch(cells, int((place >> 2) * 9 + 2 + (place & 3)));
}

void texture_of(uint cell, out vec4 rows[3]) {
    for (int i = 0; i < 3; i++) rows[i] = texelFetch(cells, int(cell * 9) + 6 + i);
}

float depth_at(uint place, vec3 ray) {
    vec4 plane = plane_at(place);
    return plane.w / dot(plane.xyz, ray);
}

// Where a ray leaves the tetrahedron that it has entered at `place`, and how deep; NOWHERE where rounding, or want of volume,
// leaves it no way out.
uint exit_of(uint place, vec3 ray, out float depth) {
    uint exit = NOWHERE;
    depth = FAR;
    for (uint i = 1; i < 4; i++) {
        uint other = (place & ~3u) | ((place + i) & 3);
        vec4 plane = plane_at(other);
        float towards_inside = dot(plane.xyz, ray);
        float at = plane.w / towards_inside;
        if (towards_inside < 0.0 && at < depth) {
            depth = at;
            exit = other;
        }
    }
    return exit;
}
