// The pictures that lights take of the scene: src/scene/shadow.rs. They lie side by side in one image.

struct LightPicture {
    vec4 from_world[3]; // rows: to the right and upwards in pixels (per depth, unless parallel), and depth, in the light's own
                        // unit; from the space in which points are lit
    vec2 middle;        // in the image, in pixels
    float half_side;    // of its square there, in pixels
    float pixel;        // distance of pixel centres: at depth 1, or of parallel rays
    uint is_parallel;   // else from a point
    float opacity_distances; // in the light's unit
    float rounding;     // what depths of points may be off by, in the light's unit
};

#ifdef LIT
// Of the lights that cast shadows, PICTURES each.
layout(set = 0, binding = 6, std140) uniform LightPictures { LightPicture light_pictures[MOST_PICTURES]; };
#else
layout(set = 0, binding = 6, std430) readonly buffer LightPictures { LightPicture light_pictures[]; };
#endif
