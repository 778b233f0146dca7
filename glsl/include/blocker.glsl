// A triangle as a light sees it.

struct Blocker {
    vec4 corners[3];     // in the light's view space, in its unit
    vec4 depth_function; // x + y, z . place: the depth, or of a light at a point its inverse
    uint picture;
};

#ifdef SOLIDS
layout(set = 0, binding = 14) uniform sampler2D blockers;
#endif

// Where a place in the picture, in pixels from its middle, lies on the triangle's plane.
float blocker_depth(vec3 depth_function, vec2 place, bool is_parallel) {
    float value = depth_function.x + dot(depth_function.yz, place);
    return is_parallel ? value : 1.0 / value;
}

// The depth beyond which a pixel's ray need not be followed, where this is the triangle at its middle: the pixel is read for places
// up to a pixel away.
float deepest_read(vec3 depth_function, vec2 place, bool is_parallel) {
    float value = depth_function.x + dot(depth_function.yz, place);
    float slope = abs(depth_function.y) + abs(depth_function.z);
    return is_parallel ? value + slope : value > slope ? 1.0 / (value - slope) : 3.0e38;
}
