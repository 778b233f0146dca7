// The transmittance along a light's ray as a piecewise linear function of depth (T. Lokovic, E. Veach, Deep shadow maps, 2000,
// section 3.2), with knots where the opacity has grown by equal parts: they crowd where it grows, and need no search for a
// tolerance. In four colours of four: how much it grows from knot to knot, the opacity of all, and the depths of the knots; after
// the last the opacity of all is reached.

const float UNRESOLVED = -1.0; // all of them, where the curve is not known

const uint CURVE_IMAGES = 4;
const uint KNOTS = 4 * CURVE_IMAGES - 2;
const uint GROWTHS = KNOTS - 1; // between knots
