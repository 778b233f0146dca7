// How the medium dims a light's ray: makes the curve of curve.glsl (Lokovic, Veach 2000), front to back. Knots are placed as the opacity
// grows; once there are too many, every other one is left out.

#include "curve.glsl"

layout(location = 0) out vec4 out_curve[CURVE_LAYERS];

// Optical depth after which what is left of the light does not count: a thousandth.
const float DARK = 7.0;
// An exponential has no end: from the last knot that an opaque ray has, 1 - 1 / GROWTHS, the line goes to where this part of the
// rest is left.
const float LEFT = 0.125;
// Shorter steps than any; keeps an infinite extinction times nothing from being no number.
const float LEAST = 1e-30;

// Passes through loops that lavapipe makes for a sample, at most: those over samples and, where knots are placed for each, over knots. Loops
// over steps that wait are none, since there are as many whatever the sample.
const uint PASSES_A_SAMPLE = 3;

// Samples whose knots are placed together, which takes hardly more than for one of them.
const uint SAMPLES_TOGETHER = 3;

float knots[KNOTS];
uint placed = 0;
float growth = LEAST_GROWTH;
uint doublings = 0; // of the growth
float all_but_dark = 3.0e38; // the depth at which LEFT is left

float optical_so_far = 0.0;
float dimmed_until = 0.0; // the depth after which nothing was

// Steps whose knots are not placed yet: where they begin, how long they are, and their optical depth; and that of all before them.
struct Step {
    float from;
    float size;
    float optical;
};

Step waiting[SAMPLES_TOGETHER] = Step[](Step(0.0, 0.0, 1.0), Step(0.0, 0.0, 1.0), Step(0.0, 0.0, 1.0));
uint waits = 0; // so many
float optical_before = 0.0;

// Goes through a step at depth `from` that has this optical depth, whose knots wait. After SAMPLES_TOGETHER steps, or fewer, `place` must
// be called.
void dim(float from, float size, float optical) {
    if (!(optical > 0.0)) return;
    for (uint i = 0; i < SAMPLES_TOGETHER; i++) {
        if (i == waits) waiting[i] = Step(from, size, optical);
    }
    waits++;
    optical_so_far += optical;
    dimmed_until = from + size;
}

// The depth in the steps that wait at which this optical depth is reached.
float reach(float wanted) {
    float before = optical_before;
    float depth = 0.0;
    bool is_found = false;
    for (uint i = 0; i < SAMPLES_TOGETHER; i++) {
        float part = clamp((wanted - before) / waiting[i].optical, 0.0, 1.0);
        if (i < waits && !is_found) depth = waiting[i].from + waiting[i].size * part;
        before += waiting[i].optical;
        is_found = is_found || wanted <= before;
    }
    return depth;
}

// Leaves out every other knot.
void thin_out() {
    for (uint i = 0; i < KNOTS / 2; i++) knots[i] = knots[2 * i];
    placed = (placed + 1) / 2;
    growth *= 2.0;
    doublings++;
}

// Places the knots that are reached in the steps that wait.
void place() {
    if (waits == 0) return;
    float grown = min(opacity(optical_so_far), 1.0);
    while (grown >= growth * float(KNOTS)) thin_out();
    for (; float(placed) * growth <= grown && placed < KNOTS; placed++) {
        knots[placed] = reach(optical_depth(float(placed) * growth));
    }
    float nearly = optical_depth(1.0 - LEFT / float(GROWTHS));
    if (optical_so_far >= nearly && all_but_dark >= 3.0e38) all_but_dark = reach(nearly);
    optical_before = optical_so_far;
    waits = 0;
}

bool is_dark() {
    return optical_so_far >= DARK;
}

void leave_unresolved() {
    for (uint i = 0; i < CURVE_LAYERS; i++) out_curve[i] = vec4(UNRESOLVED);
}

void write_curve() {
    if (optical_so_far == 0.0) {
        for (uint i = 0; i < CURVE_LAYERS; i++) out_curve[i] = vec4(0.0);
        return;
    }
    float whole = min(opacity(optical_so_far), 1.0);
    float end = min(dimmed_until, all_but_dark);
    // A line through the last knot that reaches the opacity of all at the end; beyond, there are none.
    if (placed == KNOTS) thin_out();
    float last = knots[placed - 1];
    float rest = whole - float(placed - 1) * growth;
    knots[placed] = rest > 0.0 ? last + (end - last) * growth / rest : last;
    for (uint i = placed + 1; i < KNOTS; i++) knots[i] = 3.0e38;
    out_curve[0] = packed(vec4(knots[0], knots[4], knots[8], knots[12]), doublings, whole);
    // As they will be read, and in order still.
    vec4 firsts = unpacked(out_curve[0]).firsts;
    for (uint i = 1; i < PARTS; i++) knots[4 * i] = firsts[i];
    for (uint i = KNOTS - 1; i > 0; i--) knots[i - 1] = min(knots[i - 1], knots[i]);
    for (uint i = 0; i < PARTS; i++) out_curve[1 + i] = vec4(knots[4 * i], knots[4 * i + 1], knots[4 * i + 2], knots[4 * i + 3]);
}
