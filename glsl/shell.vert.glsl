#version 450
#extension GL_ARB_shading_language_include : require
// One exit face of a tetrahedron a triangle: fetches its three vertices and the quantities from which
// shell.frag.glsl finds where the ray entered.

#include "shell.glsl"

layout(set = 0, binding = 0, std430) readonly buffer Vertices { vec4 vertices[]; }; // view space
layout(set = 0, binding = 1, std430) readonly buffer Tetrahedra { Tetrahedron tetrahedra[]; };
layout(set = 0, binding = 2, std430) readonly buffer Eyes { Eye eyes[]; };
layout(set = 0, binding = 3, std430) readonly buffer Faces { uint faces[]; }; // 4 tetrahedron + face, front to back

layout(location = 0) out vec3 exit_view;
layout(location = 1) out vec3 exit_texture;
layout(location = 2) out vec3 exit_barycentric;      // of the face's three vertices; that of the fourth is 0
layout(location = 3) flat out vec3 eye_barycentric;  // the same three
layout(location = 4) flat out vec3 eye_texture;
layout(location = 5) flat out float texels_per_unit;

void main() {
    uint face = faces[gl_VertexIndex / 3];
    uint corner = gl_VertexIndex % 3;
    uint tetrahedron = face / 4;
    uint opposite = face % 4;
    // The face's three vertices in ascending order: 0..3 without `opposite`.
    uvec3 on_face = uvec3(0, 1, 2) + uvec3(greaterThanEqual(uvec3(0, 1, 2), uvec3(opposite)));
    uint vertex = on_face[corner];

    exit_view = vertices[tetrahedra[tetrahedron].vertices[vertex]].xyz;
    exit_texture = tetrahedra[tetrahedron].texture[vertex].xyz;
    exit_barycentric = vec3(equal(uvec3(0, 1, 2), uvec3(corner)));
    Eye eye = eyes[tetrahedron];
    eye_barycentric = vec3(eye.barycentric[on_face.x], eye.barycentric[on_face.y], eye.barycentric[on_face.z]);
    eye_texture = eye.texture;
    texels_per_unit = eye.texels_per_unit;
    // Depth near / z, falling from 1 at the near plane to 0 at infinity: there is no far plane.
    gl_Position = vec4(exit_view.xy * view.clip_from_view, view.near, exit_view.z);
}
