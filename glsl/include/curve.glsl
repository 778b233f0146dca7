// The transmittance along a light's ray as a piecewise linear function of depth (T. Lokovic, E. Veach, Deep shadow maps, 2000,
// section 3.2), with knots where the opacity has grown by equal parts: they crowd where it grows, and need no search for a
// tolerance. After the last knot the opacity of all is reached.
//
// A picture for the whole and one for each part of four knots, so that two are read for a point: twice the number of times that the
// growth from knot to knot was doubled, plus the opacity of all; and the first knots of the parts after the first one. Then the parts.

const float UNRESOLVED = -1.0; // in all of them, where the curve is not known

const uint PARTS = 4;
const uint CURVE_LAYERS = 1 + PARTS;
const uint KNOTS = 4 * PARTS;
const uint GROWTHS = KNOTS - 1; // between knots
const float LEAST_GROWTH = 1.0 / (512.0 * float(GROWTHS)); // of opacity, from knot to knot
