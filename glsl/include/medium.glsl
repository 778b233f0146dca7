// The paper's medium: a path of length d has opacity 1 - (1 - alpha)^(d / opacity_distance).
// Both functions keep their relative accuracy down to the smallest alpha, where 1 - alpha rounds to 1.

// -ln(1 - alpha): log1p by Kahan's correction of the rounded argument. Infinite at alpha = 1.
float optical_depth(float alpha) {
    float clear = max(1.0 - alpha, 0.0);
    return clear == 1.0 ? alpha : -log(clear) * (alpha / (1.0 - clear));
}

// 1 - exp(-depth): below 1/32 the series, whose first term left out is depth^5 / 120 < 2^-31 depth.
float opacity(float depth) {
    float series = depth * (1.0 - depth * (1.0 / 2.0 - depth * (1.0 / 6.0 - depth * (1.0 / 24.0))));
    return depth < 0.03125 ? series : 1.0 - exp(-depth);
}

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
