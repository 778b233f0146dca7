// Opaque surfaces before the eye, where there are any.

#ifdef SOLIDS
layout(set = 0, binding = 15) uniform sampler2D solid_depths; // the first: depth, 0 where there is none

// Of the nearest at this pixel.
float solid_depth() {
    float depth = texelFetch(solid_depths, ivec2(gl_FragCoord.xy), 0).x;
    return depth > 0.0 ? depth : 3.0e38;
}
#endif
