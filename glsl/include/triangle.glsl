// A triangle of a solid as the eye sees it: src/scene/solid.rs. All rows are affine in the point, in view space.

struct Triangle {
    vec4 corners[3];
    vec4 plane;        // dot(plane.xyz, point) == plane.w
    vec4 texture[2];   // u and v: dot(row.xyz, point) + row.w
    vec4 normal[3];    // in world space, as the vertices' are interpolated: likewise
    vec4 facing;       // the plane's normal on the eye's side, in world space
    vec4 colour;       // the fourth: texels of the full texture in a unit of length
};

layout(set = 0, binding = 7, std430) readonly buffer Triangles { Triangle triangles[]; };
