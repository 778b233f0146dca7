// From tetrahedron to tetrahedron along a ray (M. Garrity, Raytracing irregular volume data, 1990): out of each by the face
// that the ray meets first, into the neighbour there. What is fetched is small and far apart, for which texels are made.

#include "crossings.glsl"

layout(set = 0, binding = 18) uniform samplerBuffer cells;    // of src/method/shell/seen.rs, nine texels each
layout(set = 0, binding = 19) uniform usamplerBuffer beyond;  // four a tetrahedron: the place beyond each face, or NOWHERE
layout(set = 0, binding = 21) uniform usamplerBuffer crossings; // places where rays enter the shell and leave it, front to back

// A place is four times a tetrahedron and the number of its face.
const uint NOWHERE = 0xffffffffu;
// In `crossings`: here the ray leaves the shell; else it enters it.
const uint LEAVES = 0x80000000u;

// Passes through loops after which a pixel is left: an eye's to the host. lavapipe runs eight pixels at once, all of them as often as the
// one that needs it most, and ends all loops after 65,535 passes.
const uint MOST_PASSES = 8000;

const float FAR = 3.0e38;

// How far off a height over a plane may be, for rounding: 2^-18 of it, or of a light's rays, whose heights are differences of numbers up
// to 1, of that.
const float STRAY = 3.814697265625e-6;

#ifdef LIGHT
// Where the ray starts, which is 0 for that of an eye; and what is known of its pixel.
vec3 origin = vec3(0.0);
float pixel_size = 0.0;
bool is_parallel = false;
#endif

// Over the ray's start.
float height_of(vec4 plane) {
#ifdef LIGHT
    return plane.w - dot(plane.xyz, origin);
#else
    return plane.w;
#endif
}

// Whether a ray is surely on the outer side of a plane at a depth.
bool is_outside(float height, float towards_inside, float depth) {
#ifdef LIGHT
    return height > depth * towards_inside + STRAY;
#else
    return height > depth * (1.0 + STRAY) * towards_inside;
#endif
}

vec4 plane_at(uint place) {
    return texelFetch(cells, int((place >> 2) * 9 + 2 + (place & 3)));
}

void texture_of(uint cell, out vec4 rows[3]) {
    for (int i = 0; i < 3; i++) rows[i] = texelFetch(cells, int(cell * 9) + 6 + i);
}

Path path_of(uint cell, vec3 ray) {
    vec4 rows[3];
    texture_of(cell, rows);
#ifdef LIGHT
    return path_from(rows, origin, ray, pixel_size, is_parallel);
#else
    return path_in(rows, ray);
#endif
}

// Parts of the shell may touch at faces that know nothing of one another, and rays may lie in the planes of those. Then f32 takes
// them to cross such a face anywhere, out into nothing or in from it. Such rays are left.

// Below this cosine a face is met too flatly.
const float FLAT = 1e-4;

// The faces of a tetrahedron as a ray meets them: first that at `place`, then the others by their numbers, going round. The ray's
// component along each inward normal, and that times its depth at the plane.
struct Faces {
    uint place;
    vec4 towards_inside;
    vec4 heights;
};

uint other_face(uint place, uint i) {
    return (place & ~3u) | ((place + i) & 3);
}

Faces faces_at(uint place, vec3 ray) {
    Faces faces;
    faces.place = place;
    for (uint i = 0; i < 4; i++) {
        vec4 plane = plane_at(other_face(place, i));
        faces.towards_inside[i] = dot(plane.xyz, ray);
        faces.heights[i] = height_of(plane);
    }
    return faces;
}

// Whether a ray enters the shell by the first of these faces as it should, there and not later; and how deep.
bool enters(Faces faces, vec3 ray, out float depth) {
    depth = faces.heights[0] / faces.towards_inside[0];
    bool is_late = false;
    for (uint i = 1; i < 4; i++) {
        float towards_inside = faces.towards_inside[i];
        is_late = is_late || (towards_inside > 0.0 && is_outside(faces.heights[i], towards_inside, depth));
    }
    return faces.towards_inside[0] > FLAT * length(ray) && !is_late;
}

// Whether a ray that leaves the shell by `exit`, after this depth, leaves it as it should: at `leave`, or as deep.
bool leaves(float depth, uint exit, uint leave, vec3 ray) {
    vec4 face = plane_at(leave);
    float towards_outside = -dot(face.xyz, ray);
    bool is_as_deep = !is_outside(-height_of(face), towards_outside, depth);
    return towards_outside > FLAT * length(ray) && (exit == leave || is_as_deep);
}

// Where a ray leaves the tetrahedron that it has entered by the first of these faces, and how deep; NOWHERE where rounding, or
// want of volume, leaves it no way out.
uint exit_of(Faces faces, out float depth) {
    uint exit = NOWHERE;
    depth = FAR;
    for (uint i = 1; i < 4; i++) {
        float at = faces.heights[i] / faces.towards_inside[i];
        if (faces.towards_inside[i] < 0.0 && at < depth) {
            depth = at;
            exit = other_face(faces.place, i);
        }
    }
    return exit;
}

// As `exit_of`, of a ray that leaves the tetrahedron by the first of these faces: where it has entered it.
uint entry_of(Faces faces, out float depth) {
    uint entry = NOWHERE;
    depth = -FAR;
    for (uint i = 1; i < 4; i++) {
        float at = faces.heights[i] / faces.towards_inside[i];
        if (faces.towards_inside[i] > 0.0 && at > depth) {
            depth = at;
            entry = other_face(faces.place, i);
        }
    }
    return entry;
}

// From where a ray leaves the shell back to where it begins in it, before the near plane; NOWHERE if it begins outside.
uint back_to_start(uint place, vec3 ray, inout uint passes) {
    float depth = 0.0;
    while (place != NOWHERE && passes < MOST_PASSES) {
        passes++;
        place = entry_of(faces_at(place, ray), depth);
        if (place == NOWHERE || depth <= view.near) break;
        place = texelFetch(beyond, int(place)).x;
    }
    return place;
}

// Where a ray that walks alone is.
struct Walker {
    int next;     // crossing
    int last;
    uint place;   // where it has entered the tetrahedron that it is in; NOWHERE outside
    float from;   // the depth to which it has come
    bool is_done; // it has nothing before it
    bool strays;
};

// What it passes in one tetrahedron, from the step `first` on.
struct Stretch {
    uint cell;
    Path path;
    Steps steps;
    uint first;
};

Stretch nothing_passed() {
#ifdef LIGHT
    return Stretch(0, Path(vec3(0.0), vec3(0.0), 0.0, is_parallel), no_steps(), 0);
#else
    return Stretch(0, Path(vec3(0.0), vec3(0.0), 0.0), no_steps(), 0);
#endif
}

Walker walker_at(int next, int last, bool is_begun, vec3 ray, inout uint passes) {
    Walker walker = Walker(next, last, NOWHERE, view.near, false, false);
    if (is_begun) {
        walker.place = back_to_start(texelFetch(crossings, next).x & ~LEAVES, ray, passes);
        walker.strays = walker.place == NOWHERE;
    }
    return walker;
}

// On to the next tetrahedron in which something may be seen, before `farthest`, or to the end of what is even. Where several pixels run
// at once, all of them wait here for one another, and march together then.
Stretch go_on(inout Walker walker, vec3 ray, float farthest, inout uint passes) {
    Stretch stretch = nothing_passed();
    while (passes < MOST_PASSES) {
        passes++;
        stretch.first = 0;
        stretch.steps.count = 0;
        bool is_entering = walker.place == NOWHERE;
        if (is_entering) {
            if (even_waits()) break; // it ends here
            walker.is_done = walker.next == walker.last;
            if (walker.is_done) break;
            uint crossing = texelFetch(crossings, walker.next++).x;
            if ((crossing & LEAVES) != 0) continue;
            walker.place = crossing;
        }
        stretch.cell = walker.place >> 2;
        // Of all tetrahedra alike, also where the ray goes on: to lavapipe a branch saves nothing, so that what is read here is read
        // once for both.
        Faces faces = faces_at(walker.place, ray);
        if (is_entering) {
            float depth;
            bool is_sound = enters(faces, ray, depth) || depth >= farthest;
            walker.strays = walker.strays || !is_sound;
            walker.from = max(walker.from, depth);
        }
        float depth;
        uint exit = exit_of(faces, depth);
        vec2 segment = vec2(walker.from, min(depth, farthest));
        if (exit != NOWHERE && segment.y > segment.x) {
            stretch.path = path_of(stretch.cell, ray);
            stretch.steps = steps_of(stretch.path, segment);
#ifdef LIGHT
            // That an eye's rays have fewer the host has seen to.
            if (stretch.steps.count >= (MOST_PASSES - passes) / PASSES_A_SAMPLE) {
                stretch.steps.count = 0;
                passes = MOST_PASSES;
            }
#endif
            stretch.first = seek(stretch.path, stretch.steps, 0, passes);
            walker.from = segment.y;
        }
        walker.is_done = walker.from >= farthest;
        walker.place = exit == NOWHERE || walker.is_done ? NOWHERE : texelFetch(beyond, int(exit)).x;
        if (walker.place == NOWHERE && !walker.is_done && walker.next < walker.last) {
            uint leave = texelFetch(crossings, walker.next).x;
            if ((leave & LEAVES) != 0) {
                walker.next++;
                walker.strays = walker.strays || !leaves(walker.from, exit, leave & ~LEAVES, ray);
            }
        }
        if (stretch.first < stretch.steps.count || even_is_full() || walker.is_done || walker.strays) break;
    }
    return stretch;
}
