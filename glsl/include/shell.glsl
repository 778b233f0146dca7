// What the shell shaders share with src/method/shell; tests/layout.rs compares the two from the SPIR-V.
// Bindings: 0 to 7 are buffers, from 8 on textures, 18 to 21 and 23 rows of texels, 24 the picture
// itself; each has one number in all shaders.
//
// View space here: origin at the eye, x right, y up, z = depth *into* the picture. Lengths are in parts of `Seen::unit`.

layout(push_constant, std430) uniform View {
    vec2 centre;         // of the picture, in pixels
    float pixel;         // distance of pixel centres at depth 1
    float near;          // depth of the near plane
    vec3 texels;         // size of level 0 of the volume
    float last_level;
    float lod_scale;     // footprint of a pixel at depth 1
    float per_opacity_distance; // 1 / opacity_distance
    float step;          // `default` plan: texels a sample
    uint samples;        // `paper` plan: samples a tetrahedron
    vec4 even;          // the texel that much of the volume is like, where that is something
    uint even_steps;    // how many steps in it are one, at most
} view;

// A tetrahedron as seen from the eye.
struct Cell {
    vec4 outline[2];     // four corners in clip space (x, y, x, y), around all that it covers
    vec4 planes[4];      // inside: dot(plane.xyz, point) >= plane.w; the same numbers, negated, in the cell beyond the face
    vec4 texture[3];     // u, v, w of a point: dot(row.xyz, point) + row.w
};

// A rectangle of pixels, and what is seen in it.
struct Tile {
    vec4 bounds;         // clip space: left, top, right, bottom
    uvec2 members;       // range of the list of cells, or of triangles: first, end
    uint picture;        // of a light: which
    uint coarsely;       // of a light: whether its rays take the longest steps
};
