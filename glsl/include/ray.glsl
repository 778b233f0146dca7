// The ray of a fragment and its interval in a tetrahedron. Both are exact per pixel: the rasteriser only says where to look.

// In view space, at depth 1; image rows run down.
vec3 pixel_ray() {
    return vec3((gl_FragCoord.xy - view.centre) * vec2(view.pixel, -view.pixel), 1.0);
}

// Whether a ray in the plane of a face counts as inside: as if it were moved to the right, and by far less up, so that of the
// two cells at the face it is in one.
bool is_beside(vec3 inward) {
    return inward.x > 0.0 || (inward.x == 0.0 && inward.y > 0.0);
}

// Depths of entry and exit (Cyrus-Beck clipping), entry no nearer than the near plane; entry < exit where the ray meets the
// tetrahedron. `heights` are those of the planes above the ray's origin. Cells that share a face hold the same plane, negated:
// one ends bit for bit where the other begins.
vec2 clip(vec4 planes[4], float heights[4], vec3 ray) {
    float entry = view.near;
    float exit = 3.0e38;
    for (int i = 0; i < 4; i++) {
        float towards_inside = dot(planes[i].xyz, ray);
        float depth = heights[i] / towards_inside;
        if (towards_inside > 0.0) entry = max(entry, depth);
        else if (towards_inside < 0.0) exit = min(exit, depth);
        else if (heights[i] > 0.0 || (heights[i] == 0.0 && !is_beside(planes[i].xyz))) exit = entry; // parallel to the face
    }
    return vec2(entry, exit);
}

// Of a ray from the eye.
vec2 interval(vec4 planes[4], vec3 ray) {
    return clip(planes, float[](planes[0].w, planes[1].w, planes[2].w, planes[3].w), ray);
}

// Of a ray from elsewhere.
vec2 interval_from(vec4 planes[4], vec3 origin, vec3 ray) {
    float heights[4];
    for (int i = 0; i < 4; i++) heights[i] = planes[i].w - dot(planes[i].xyz, origin);
    return clip(planes, heights, ray);
}
