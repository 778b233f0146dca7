// Where the rays of pixels cross the boundary of the shell: src/order/crossings.rs.

layout(constant_id = 5) const bool INSIDE = false; // whether rays begin in the shell

layout(set = 0, binding = 20) uniform usamplerBuffer of_pixels; // each pixel's range of `crossings`, row by row

// In the first number of `of_pixels`: the ray is in two parts of the shell at once; it begins in the shell.
const uint INTRICATE = 0x80000000u;
const uint BEGUN = 0x40000000u;

// The crossings of a pixel, from `next` to before `last`; returns whether its ray is intricate. Where several pixels run at once, those
// that are discarded may run on with the others: so that they soon stop, they should have no crossings then.
bool crossings_of(uvec2 pixel, out int next, out int last, out bool is_begun) {
    uvec2 range = texelFetch(of_pixels, int(pixel.y * uint(2.0 * view.centre.x) + pixel.x)).xy;
    next = int(range.x & ~(INTRICATE | BEGUN));
    last = int(range.y);
    is_begun = INSIDE && (range.x & BEGUN) != 0;
    return (range.x & INTRICATE) != 0;
}
