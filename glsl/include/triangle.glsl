// A triangle of a solid as the eye sees it: src/scene/solid.rs. All rows are affine in the point, in view space.

struct Triangle {
    vec4 corners[3];
    vec4 plane;        // dot(plane.xyz, point) == plane.w
};

layout(set = 0, binding = 7, std430) readonly buffer Triangles { Triangle triangles[]; };
