// The transmittance along a light's ray as a piecewise linear function of depth (T. Lokovic, E. Veach, Deep shadow maps, 2000,
// section 3.2), but with knots where it has fallen by equal parts: they crowd where it falls, and need no search for a
// tolerance. In four colours of four: the opacity of all, then the depths of the knots.

const uint CURVE_IMAGES = 4;
const uint KNOTS = 4 * CURVE_IMAGES - 1;
const uint FALLS = KNOTS - 1; // between knots
