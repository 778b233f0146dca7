// What the shell shaders share with src/method/shell.rs; tests/layout.rs compares the two from the SPIR-V.
//
// View space here: origin at the eye, x right, y up, z = depth *into* the picture.

layout(push_constant, std430) uniform View {
    vec2 clip_from_view; // factors of x and y
    float near;          // depth of the near plane, world units
    float lod_scale;     // footprint of a pixel at depth 1, world units; times depth times texels per unit
    vec3 texels;         // size of level 0 of the volume
    float last_level;
    float per_opacity_distance; // 1 / opacity_distance
    float step;          // `default` plan: texels a sample
    uint samples;        // `paper` plan: samples a tetrahedron
} view;

// Stays while the shell stays.
struct Tetrahedron {
    uvec4 vertices;      // shell vertex ids
    vec4 texture[4];     // (u, v, w) at the vertices; the last component is unused
};

// The affine functions of a tetrahedron, continued to the eye: changes with the eye.
struct Eye {
    vec4 barycentric;    // barycentric coordinates of the eye
    vec3 texture;        // texture coordinates of the eye
    float texels_per_unit; // largest density of texels in the tetrahedron, per world unit
};
