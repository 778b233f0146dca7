// The transmittance along a light's ray as a piecewise linear function of depth (T. Lokovic, E. Veach, Deep shadow maps, 2000,
// section 3.2), with knots where the opacity has grown by equal parts: they crowd where it grows, and need no search for a
// tolerance. After the last knot the opacity of all is reached.
//
// A picture for the whole and one for each part of four knots, so that two are read for a point. The first holds the depth of the first
// knot, as it is, and how much deeper the first of each of the other three parts is, cut to the upper 24 bits of an f32. The lower bits
// of those three tell how often the growth from knot to knot was doubled, and the opacity of all.

const float UNRESOLVED = -1.0; // in all of them, where the curve is not known

const uint PARTS = 4;
const uint CURVE_LAYERS = 1 + PARTS;
const uint KNOTS = 4 * PARTS;
const uint GROWTHS = KNOTS - 1; // between knots
const float LEAST_GROWTH = 1.0 / (512.0 * float(GROWTHS)); // of opacity, from knot to knot

const uint TOLD_BITS = 8; // in each of three numbers
const uint TOLD = (1u << TOLD_BITS) - 1u;
const uint OPACITY_BITS = 20; // of all 24; the others hold the number of doublings
const uint MOST_OPACITY = (1u << OPACITY_BITS) - 1u;
// No depth differs by so little. Of nothing the lower bits would be a denormal number, which devices may flush.
const float LEAST_DIFFERENCE = 1e-30;

// What is told of a light's ray as a whole.
struct Curve {
    vec4 firsts;   // the depth of the first knot of each part
    float growth;  // of the opacity, from knot to knot
    float opacity; // of all
};

vec4 packed(vec4 firsts, uint doublings, float opacity) {
    uint told = doublings << OPACITY_BITS | uint(round(opacity * float(MOST_OPACITY)));
    uvec3 bits = floatBitsToUint(max(firsts.yzw - firsts.x, LEAST_DIFFERENCE)) & ~TOLD;
    return vec4(firsts.x, uintBitsToFloat(bits | uvec3(told, told >> TOLD_BITS, told >> 2 * TOLD_BITS) & TOLD));
}

Curve unpacked(vec4 numbers) {
    uvec3 bits = floatBitsToUint(numbers.yzw);
    uvec3 parts = bits & TOLD;
    uint told = parts.x | parts.y << TOLD_BITS | parts.z << 2 * TOLD_BITS;
    vec4 firsts = vec4(numbers.x, numbers.x + uintBitsToFloat(bits & ~TOLD));
    // The power of two as its bits: an eighth of what `exp2` takes.
    float growth = uintBitsToFloat((127u + (told >> OPACITY_BITS)) << 23) * LEAST_GROWTH;
    int opacity = int(told & MOST_OPACITY); // signed, which processors convert at once
    return Curve(firsts, growth, float(opacity) / float(MOST_OPACITY));
}
