// Media in one place add: extinctions do, and colours in proportion to them. Of walls, which have no extinction, the mean is seen.

struct Sum {
    float depth;   // optical
    vec3 emission; // straight colour times optical depth
    uint walls;
    vec3 wall;
};

Sum nothing() {
    return Sum(0.0, vec3(0.0), 0, vec3(0.0));
}

// What a texel adds over a path, in opacity distances.
void add(inout Sum sum, vec4 texel, float path) {
    if (!EXTINCTION && texel.a >= 1.0) {
        sum.walls++;
        sum.wall += texel.rgb;
    } else if (texel.a > LEAST) {
        float depth = optical_of(texel, path);
        sum.depth += depth;
        sum.emission += emitted(texel, depth);
    }
}

// Of a wall it is without bound.
float optical_of(Sum sum) {
    return sum.walls > 0 ? 3.0e38 : sum.depth;
}

// Premultiplied.
vec4 mixture(Sum sum) {
    float alpha = sum.walls > 0 ? 1.0 : opacity(sum.depth);
    vec3 colour = sum.walls > 0 ? sum.wall / float(sum.walls)
        : sum.depth > LEAST ? sum.emission * (alpha / sum.depth) : vec3(0.0);
    return vec4(colour, alpha);
}
