// Reads the volume along a ray in one tetrahedron, at the level of detail of the pixel's footprint.

const uint PLAN_DEFAULT = 0; // midpoints, spread by length
const uint PLAN_PAPER = 1;   // midpoints, as many in every tetrahedron
const uint PLAN_EXACT = 2;   // Gauss in each voxel

// `Levels` of src/method/shell/constants.rs
const uint LEVELS_FIRST = 0;
const uint LEVELS_BLENDED_BY_SHADER = 1;
const uint LEVELS_BLENDED_BY_DEVICE = 2;

layout(constant_id = 0) const uint PLAN = 0;
layout(constant_id = 1) const uint LEVELS = LEVELS_BLENDED_BY_SHADER;
const bool MINIFIED = LEVELS != LEVELS_FIRST; // whether any level but 0 can be needed

layout(constant_id = 2) const bool EXTINCTION = false; // what the fourth channel holds; else opacity

layout(set = 0, binding = 8) uniform sampler3D volume; // premultiplied

// The texture along a ray: affine in depth.
struct Path {
    vec3 at_eye;      // texture coordinates at depth 0
    vec3 from_depth;  // and their change per unit of depth
    float detail;     // footprint of the pixel at depth 1, in level-0 texels
#ifdef LIGHT
    bool is_parallel; // all pixels' rays are; the footprint is the same everywhere
#endif
};

// The greatest density of level-0 texels along an axis across the ray, times the ray's length: a pixel has no width along it.
float texels_across(vec4 rows[3], vec3 ray) {
    vec3 across = view.texels
        * vec3(length(cross(rows[0].xyz, ray)), length(cross(rows[1].xyz, ray)), length(cross(rows[2].xyz, ray)));
    return max(across.x, max(across.y, across.z));
}

#ifdef LIGHT
// Of a light, whose footprint grows with the distance from it.
Path path_from(vec4 rows[3], vec3 origin, vec3 ray, float pixel, bool is_parallel) {
    return Path(vec3(dot(rows[0].xyz, origin), dot(rows[1].xyz, origin), dot(rows[2].xyz, origin))
                    + vec3(rows[0].w, rows[1].w, rows[2].w),
                vec3(dot(rows[0].xyz, ray), dot(rows[1].xyz, ray), dot(rows[2].xyz, ray)),
                view.lod_scale * pixel * texels_across(rows, ray), is_parallel);
}
#else
Path path_in(vec4 rows[3], vec3 ray) {
    return Path(vec3(rows[0].w, rows[1].w, rows[2].w),
                vec3(dot(rows[0].xyz, ray), dot(rows[1].xyz, ray), dot(rows[2].xyz, ray)),
                view.lod_scale * texels_across(rows, ray) / length(ray));
}
#endif

float level_of_detail(Path path, float depth) {
#ifdef LIGHT
    if (path.is_parallel) depth = 1.0;
#endif
    return clamp(log2(depth * path.detail), 0.0, view.last_level);
}

// Of a texture at the level of detail that is right there. Many devices round the weight by which they blend two levels.
vec4 fetch_from(sampler3D texels, Path path, float depth) {
    vec3 point = path.at_eye + depth * path.from_depth;
    if (!MINIFIED) return textureLod(texels, point, 0.0);
    float level = level_of_detail(path, depth);
    if (LEVELS == LEVELS_BLENDED_BY_DEVICE) return textureLod(texels, point, level);
    float fine = floor(level);
    return mix(textureLod(texels, point, fine), textureLod(texels, point, min(fine + 1.0, view.last_level)), level - fine);
}

vec4 fetch(Path path, float depth) {
    return fetch_from(volume, path, depth);
}

#ifdef LIGHT
float longer = 1.0; // by what steps are longer than the plan's
#endif

// How many samples the plan gives to a segment: no more than `MOST_SAMPLES` of src/method/shell.
uint sample_count(Path path, float entry, float exit) {
    if (PLAN == PLAN_PAPER) return view.samples;
    float texel = MINIFIED ? exp2(floor(level_of_detail(path, 0.5 * (entry + exit)))) : 1.0;
    float texels = length(path.from_depth * view.texels) * (exit - entry) / texel;
#ifdef LIGHT
    texels /= longer;
#endif
    return uint(clamp(ceil(texels / view.step), 1.0, 65535.0));
}

#ifdef SPARSE
layout(set = 0, binding = 22) uniform sampler3D proximity; // of src/volume/proximity.rs, in parts of 255: to what is not empty or even

// At a point of the texture, in texels of a level.
float distance_at(vec3 point, float level) {
    uint both = uint(round(255.0 * textureLod(proximity, point, MINIFIED ? max(level, 0.0) : 0.0).x));
    return float(MINIFIED ? both >> 4 : both & 15);
}
#endif

// A segment in equal steps.
struct Steps {
    float begin;
    float size;
    uint count;
#ifdef SPARSE
    float level;     // at which distances are looked up; negative where that cannot be
    float per_texel; // steps, of that level, along the axis on which they are longest
#endif
};

Steps steps_of(Path path, vec2 segment) {
    uint count = sample_count(path, segment.x, segment.y);
    float size = (segment.y - segment.x) / float(count);
#ifdef SPARSE
    float level = 0.0;
    bool is_known = true;
    if (MINIFIED) {
        // Samples read this level and the next, or the one before and this: those for which distances are.
        level = floor(level_of_detail(path, segment.y));
        is_known = floor(level_of_detail(path, segment.x)) >= level - 1.0;
    }
    // Not by textureSize: lavapipe 22.3 gives all pixels that run at once that of the first one's level.
    vec3 texels = abs(path.from_depth) * vec3(max(uvec3(view.texels) >> uint(level), uvec3(1)));
    float texel = max(texels.x, max(texels.y, texels.z)) * size;
    // A little less, for rounding.
    return Steps(segment.x, size, count, is_known ? level : -1.0, 0.999 / max(texel, 1e-4));
#else
    return Steps(segment.x, size, count);
#endif
}

Steps no_steps() {
#ifdef SPARSE
    return Steps(0.0, 0.0, 0, 0.0, 0.0);
#else
    return Steps(0.0, 0.0, 0);
#endif
}

// The depth of the sample of a step.
float middle(Steps steps, uint i) {
    return steps.begin + (float(i) + 0.5) * steps.size;
}

#ifdef EVEN
// What of the ray was passed, but is not yet sampled, since it goes on: the texture there is `view.even`.
struct Even {
    float begin; // depths
    float end;
    uint steps;
};

Even even = Even(0.0, 0.0, 0);

// Adds what follows.
void pass_evenly(float begin, float end, uint steps) {
    if (even.steps == 0) even.begin = begin;
    if (steps > 0) even.end = end;
    even.steps += steps;
}

// Whether all of these steps are even, as far as is known from their middle.
bool are_even(Path path, Steps steps) {
    float along = 0.5 * float(steps.count);
    vec3 point = path.at_eye + (steps.begin + along * steps.size) * path.from_depth;
    float distance = distance_at(point, steps.level);
    return steps.level >= 0.0 && (distance - 1.0) * steps.per_texel >= along;
}
#endif

// Whether there is such a stretch.
bool even_waits() {
#ifdef EVEN
    return even.steps > 0;
#else
    return false;
#endif
}

// Whether no more may be added to it.
bool even_is_full() {
#ifdef EVEN
    return even.steps >= view.even_steps;
#else
    return false;
#endif
}

// The first step from `i` on in which something may be seen: those that are left out see nothing, or, where much of the volume is one
// even medium, that. Counts passes through its loop.
uint seek(Path path, Steps steps, uint i, inout uint passes) {
#ifdef SPARSE
    // It has two ends: see `march_midpoints`.
    for (; i < steps.count;) {
        vec3 point = path.at_eye + middle(steps, i) * path.from_depth;
        float distance = distance_at(point, steps.level);
        passes++;
        bool is_near = distance == 0.0 || steps.level < 0.0;
        uint leap = is_near ? 0 : 1 + uint((distance - 1.0) * steps.per_texel);
#ifdef EVEN
        leap = min(leap, min(steps.count - i, view.even_steps - even.steps));
        pass_evenly(steps.begin + float(i) * steps.size, steps.begin + float(i + leap) * steps.size, leap);
#endif
        i += leap;
        if (is_near || i >= steps.count || even_is_full()) break;
    }
#endif
    return i;
}

// What is sampled at once: a step, or all of an even stretch.
struct Part {
    float begin; // depths
    float middle;
    float size;
    bool is_even;
};

// The next one, which is step `i` where nothing else waits.
Part next_part(Steps steps, inout uint i) {
    Part part = Part(steps.begin + float(i) * steps.size, middle(steps, i), steps.size, false);
#ifdef EVEN
    float size = even.end - even.begin;
    if (even_waits()) part = Part(even.begin, even.begin + 0.5 * size, size, true);
    even.steps = 0;
#endif
    i += part.is_even ? 0 : 1;
    return part;
}

// Optical depth of a path of one opacity distance through this texel.
float extinction(vec4 texel) {
    return EXTINCTION ? texel.a : optical_depth(texel.a);
}
