// Quadrature of `integral of T sigma c` along one ray in one tetrahedron.

// What a ray has gathered, front to back.
struct Light {
    Gathered gathered;
    float depth;         // integral of T sigma z dz, in depth along the ray
};

// Below this an alpha counts as none: quotients of denormal numbers are not numbers where they are flushed to zero.
const float LEAST = 1e-30;

// Whether so little is let through that the rest is not looked at.
bool is_saturated(Light light) {
    return transmittance(light.gathered) <= SATURATED;
}

#ifdef LIT
#include "shade.glsl"
#else
#define radiant fetch // unlit, a texel's colour is what it sends out
#endif

// Passes through loops that one costs: its own, and one for each light that is not unrolled.
#ifdef LIT
const uint PASSES_A_SAMPLE = LIGHTS > UNROLLED ? 1 + LIGHTS - UNROLLED : 1;
#else
const uint PASSES_A_SAMPLE = 1;
#endif

// Optical depth of a path through this texel. A wall stops the ray however short the path: `LEAST` keeps infinity times nothing from
// being no number.
float optical_of(vec4 texel, float path) {
    return extinction(texel) * max(path, LEAST);
}

// Straight colour times `amount` of opacity, of a texel whose colour is premultiplied by its own alpha or extinction.
vec3 emitted(vec4 texel, float amount) {
    return texel.a > LEAST ? texel.rgb * (amount / texel.a) : vec3(0.0);
}

// How far into a step of an optical depth, in parts of it, the mean of what is sent out comes from.
//
// Where the extinction is the same everywhere that is `1 / t - exp(-t) / (1 - exp(-t))`; below 1/2 the series, whose first term left out is
// t^5 / 30240 < 2^-19. Where it grows along the step as `1 + rise (2 u - 1)`, u from 0 to 1 and `rise` from -1 to 1/2, it is farther by
// `rise / 6` if t is small, and by `rise / ((1 - rise) t)` if it is large; what joins the two here is off by 0.01 at most.
float mean_depth(float optical, float alpha, float rise) {
    float series = 0.5 - optical * (1.0 / 12.0 - optical * optical * (1.0 / 720.0));
    float even = optical < 0.5 ? series : 1.0 / optical - (1.0 - alpha) / alpha;
    return even + rise / (6.0 + (1.0 - rise) * optical * (1.0 - 4.0 / (4.0 + optical)));
}

// The depth at which a step is lit, and which it counts as: the mean of where what it sends out comes from. Of a dense one that is near
// its beginning, not in its middle, where it would be in its own shadow. The paper's plan takes the middle.
float depth_of_step(float begin, float size, float optical, float alpha, float rise) {
    return begin + size * (PLAN == PLAN_PAPER ? 0.5 : mean_depth(optical, alpha, rise));
}

// Of the last sample: extinctions of two that are neighbours tell how it grows.
float last_extinction = 0.0;
float last_end = 0.0; // the depth where its part of the ray ends

// How the extinction grows along a step whose sample has this one, for `mean_depth`: from the sample before it; steps that were left out
// have none. It is the same all along where `is_first`: where nothing before it is known. Remembers it as the last one.
float rise_since_last(float begin, float size, float extinction, bool is_first) {
    float here = min(extinction, 1e30);
    float before = last_end < begin - 0.5 * size ? 0.0 : last_extinction;
    last_extinction = here;
    last_end = begin + size;
    return is_first || here == 0.0 ? 0.0 : 0.5 - 0.5 * min(before / here, 3.0);
}

// Of a ray that is saturated before its end: what is behind is taken for more of what came since `before`, or of all where that is so
// little that its rounding counts, and lies where that ended. It is nearer to that than to nothing.
void fill_up(inout Light light, Light before) {
    if (!is_saturated(light)) return;
    vec4 since = light.gathered.rgba - before.gathered.rgba;
    if (since.a < 1.0 / 1024.0) since = light.gathered.rgba;
    light.depth += transmittance(light.gathered) * last_end;
    lay_behind(light.gathered, since / since.a);
}

#if defined(WALKS) && defined(LIT)
// Samples that are taken in a tetrahedron before the rays of other pixels, which run at once and wait, go on to their next one. Unlit
// ones, which cost less than to ask whose turn it is, are all taken.
#define FEW_AT_A_TIME
const uint AT_A_TIME = 2;
#endif

// Midpoint rule over the steps from number `i` on, which becomes that of the next: the texture is constant over a step, and the
// exponential is exact. Light and directions are those of `depth_of_step`. What is even is one step, however long. Where
// `FEW_AT_A_TIME`, it stops after so many, or where nothing more is seen; where `WALKS`, what is even at the end is left to wait.
// Counts passes through loops.
void march_midpoints(Path path, Steps steps, inout uint i, float per_depth, inout Light light, inout uint passes) {
#ifdef FEW_AT_A_TIME
    uint taken = 0;
#endif
    // Where several pixels run at once, a test at the end costs no pass that nobody needs; but a loop whose only end that is lavapipe
    // 22.3 gets wrong: what a pixel that is done has summed is summed again, in part, as the others go on. So it has another at the top.
    for (; i < steps.count || even_waits();) {
        Part part = next_part(steps, i);
        vec4 texel = fetch(path, part.middle);
#ifdef EVEN
        if (part.is_even) texel = view.even;
#endif
        float optical = optical_of(texel, part.size * per_depth);
        float alpha = opacity(optical);
        // In another tetrahedron the texture may be another.
        bool is_first = part.begin <= steps.begin || part.is_even;
        float rise = rise_since_last(part.begin, part.size, extinction(texel), is_first);
        float z = depth_of_step(part.begin, part.size, optical, alpha, rise);
#ifdef LIT
        texel = lit(texel, part.is_even ? vec4(0.0) : fetch_from(directions, path, z), z);
#endif
        light.depth += transmittance(light.gathered) * alpha * z;
        lay_behind(light.gathered, vec4(emitted(texel, alpha), alpha));
        passes += PASSES_A_SAMPLE;
        i = seek(path, steps, i, passes);
#if defined(FEW_AT_A_TIME)
        taken++;
        if (i >= steps.count || taken == AT_A_TIME || is_saturated(light)) break;
#elif defined(WALKS)
        if (i >= steps.count) break;
#else
        if (i >= steps.count && !even_waits()) break;
#endif
    }
}

// Depths at which the ray crosses planes of texel centres of a level: the next one on each axis, and their distance.
struct Lattice {
    vec3 next;
    vec3 spacing;
};

Lattice lattice_of(Path path, float level, float from) {
    vec3 size = max(floor(view.texels * exp2(-level)), vec3(1.0));
    vec3 place = (path.at_eye + from * path.from_depth) * size - 0.5;
    vec3 speed = path.from_depth * size;
    vec3 ahead = mix(place - floor(place), 1.0 - (place - floor(place)), greaterThan(speed, vec3(0.0)));
    // A ray along an axis' planes never crosses them: 3e38 then, from the division by the least normal number.
    vec3 spacing = min(1.0 / max(abs(speed), vec3(1.2e-38)), vec3(3.0e38));
    return Lattice(from + ahead * spacing, spacing);
}

float first(vec3 a) {
    return min(a.x, min(a.y, a.z));
}

void pass(inout Lattice lattice, float depth) {
    lattice.next += mix(vec3(0.0), lattice.spacing, lessThanEqual(lattice.next, vec3(depth)));
}

// Three-point Gauss-Legendre on 0..1, and the integral of the cubic through the start and the three nodes from the start to
// each node: rows of nodes, columns of samples. A cubic's optical depth comes out exact.
const vec3 GAUSS_NODES = vec3(0.11270166537925831, 0.5, 0.88729833462074169);
const vec3 GAUSS_WEIGHTS = vec3(5.0, 8.0, 5.0) / 18.0;
const vec3 CUMULATIVE_START = vec3(0.05, -0.0625, 0.05);
const mat3 CUMULATIVE = mat3(0.064947361003827059, 0.39269010483719180, 0.19404680587740725,
                             -0.0026433341916055684, 0.18055555555555552, 0.51375444530271663,
                             0.00039763856703680002, -0.010745660392747408, 0.12949708344061736);

// One piece of a ray within one cell of texel centres, where the texture is a cubic. `start` is the texel value's
// extinction at its beginning. Returns that at its end.
void march_piece(Path path, float from, float to, float per_depth, float start, inout Light light) {
    float h = to - from;
    if (!(h > 0.0)) return; // a sixteenth of some roundings
    vec3 z = from + h * GAUSS_NODES;
    vec4 texels[3] = vec4[](radiant(path, z.x), radiant(path, z.y), radiant(path, z.z));
    vec3 sigma = vec3(extinction(texels[0]), extinction(texels[1]), extinction(texels[2])) * per_depth;
    float whole = h * dot(GAUSS_WEIGHTS, sigma);
    vec3 until = h * (CUMULATIVE_START * start * per_depth + CUMULATIVE * sigma);
    // Optical depths up to the nodes rise from 0 to the whole; of an opacity near 1, which is no cubic, the interpolant may not.
    until = clamp(until, vec3(0.0), vec3(whole));
    vec3 amount = h * GAUSS_WEIGHTS * sigma * exp(-until);
    float alpha = opacity(whole);
    if (whole < 3.0e38) {
        // The proportions are Gauss's, but the sum is the exact opacity: nothing is gained or lost, however dense.
        float sum = amount.x + amount.y + amount.z;
        amount *= sum > LEAST ? alpha / sum : 0.0;
    } else {
        // The ray ends at the first node where alpha is 1.
        bvec3 wall = greaterThan(sigma, vec3(3.0e38));
        amount = alpha * (wall.x ? vec3(1.0, 0.0, 0.0) : wall.y ? vec3(0.0, 1.0, 0.0) : vec3(0.0, 0.0, 1.0));
    }
    light.depth += transmittance(light.gathered) * dot(amount, z);
    lay_behind(light.gathered, vec4(emitted(texels[0], amount.x) + emitted(texels[1], amount.y)
                                    + emitted(texels[2], amount.z), alpha));
}

// Goes from plane to plane of texel centres, of both levels that are blended; dense pieces are cut further.
void march_exactly(Path path, vec2 segment, float per_depth, inout Light light) {
    float level = MINIFIED ? floor(level_of_detail(path, 0.5 * (segment.x + segment.y))) : 0.0;
    Lattice fine = lattice_of(path, level, segment.x);
    Lattice coarse = lattice_of(path, min(level + 1.0, view.last_level), segment.x);
    float from = segment.x;
    float start = extinction(fetch(path, from));
    // As many planes as a device may be asked to pass; where depths in f32 do not tell two of them apart, too, there is an end.
    for (uint planes = 0; planes < 65535 && from < segment.y && transmittance(light.gathered) > 1e-7; planes++) {
        float to = min(segment.y, first(fine.next));
        if (MINIFIED) to = min(to, first(coarse.next));
        pass(fine, to);
        if (MINIFIED) pass(coarse, to);
        if (!(to > from)) continue;
        float end = extinction(fetch(path, to));
        // Gauss errs by depth^6 / 2e6 of the piece's light: 2^-24 at an optical depth of two thirds.
        float optical = max(start, end) * (to - from) * per_depth;
        uint parts = uint(clamp(ceil(1.5 * optical), 1.0, 16.0));
        float part = (to - from) / float(parts);
        for (uint i = 0; i < parts; i++) {
            float a = from + float(i) * part;
            if (i > 0) start = extinction(fetch(path, a));
            march_piece(path, a, i + 1 == parts ? to : a + part, per_depth, start, light);
        }
        start = end;
        from = to;
    }
}

// By the scene's plan. `LEAST` as in `optical_of`.
void march(Path path, vec2 segment, float per_depth, inout Light light) {
    if (PLAN == PLAN_EXACT) {
        march_exactly(path, segment, max(per_depth, LEAST), light);
    } else {
        Steps steps = steps_of(path, segment);
        uint passes = 0;
        uint i = seek(path, steps, 0, passes);
        march_midpoints(path, steps, i, per_depth, light, passes);
    }
}
