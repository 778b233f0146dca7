// The paper's medium: a path of length d has opacity 1 - (1 - alpha)^(d / opacity_distance).
// Both functions keep their relative accuracy down to the smallest alpha, where 1 - alpha rounds to 1.

// -ln(1 - alpha), infinite at alpha = 1. Vulkan's logarithm is off by up to 2^-21 next to 1, whatever is left of it there; so
// below 1/4 it is 2 artanh(s) with s = alpha / (2 - alpha) < 1/7, whose first term left out is s^8 / 9 < 2^-25 of it.
float optical_depth(float alpha) {
    float s = alpha / (2.0 - alpha);
    float q = s * s;
    float series = 2.0 * s * (1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0))));
    return alpha < 0.25 ? series : -log(max(1.0 - alpha, 0.0));
}

// 1 - exp(-depth): below 1/32 the series, whose first term left out is depth^4 / 120 < 2^-26 of it.
float opacity(float depth) {
    float series = depth * (1.0 - depth * (1.0 / 2.0 - depth * (1.0 / 6.0 - depth * (1.0 / 24.0))));
    return depth < 0.03125 ? series : 1.0 - exp(-depth);
}

layout(constant_id = 6) const float SATURATED = 0.0; // where no more is let through the rest is not looked at

// What a ray has gathered, front to back. Sums are compensated (Kahan 1965), so that the steps of a long path through a thin
// medium, each of which would be rounded to the last bit of the sum, add up.
struct Gathered {
    vec4 rgba; // premultiplied
    vec4 excess; // what rounding has added to it
};

// Of the light from behind. Never less exact than alpha itself; a product of transmittances would be, where each is next to 1.
float transmittance(Gathered gathered) {
    return max(1.0 - gathered.rgba.a, 0.0);
}

void lay_behind(inout Gathered gathered, vec4 rgba) {
    precise vec4 added = transmittance(gathered) * rgba - gathered.excess;
    precise vec4 sum = gathered.rgba + added;
    precise vec4 excess = (sum - gathered.rgba) - added;
    gathered = Gathered(sum, excess);
}
