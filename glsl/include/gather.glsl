// The members of a tile that a ray meets, sorted along it.

layout(set = 0, binding = 0, std430) readonly buffer Cells { Cell cells[]; };
layout(set = 0, binding = 2, std430) readonly buffer List { uint list[]; }; // of cells, by tile

layout(location = 0) flat in uvec2 members; // range of the list of cells: first, end

// Depth at which the ray ends.
float farthest = 3.0e38;

// Passes through loops after which a pixel is left to the host. lavapipe ends all loops of a pixel after 65,535, and says nothing;
// and a device that is busy for seconds is taken for hung.
const uint MOST_PASSES = 60000;
uint passes = 0;
// lavapipe runs eight pixels at once, all of them as often as the one that needs it most: what differs among them may count
// eightfold.
const uint AT_ONCE = 8;

// The nearest of the members that the ray meets, by entry, and where it meets them.
const uint MOST_HITS = 64;
uint hits[MOST_HITS];
vec2 spans[MOST_HITS];

// Fills `hits` and `spans` with members that end beyond depth `done`; returns their number, and in `horizon` the depth up to
// which no other member reaches.
uint gather(vec3 origin, vec3 ray, float done, out float horizon) {
    uint count = 0;
    horizon = 3.0e38;
    passes += 2 * (members.y - members.x);
    for (uint member = members.x; member < members.y; member++) {
        uint cell = list[member];
        vec2 span = interval_from(cells[cell].planes, origin, ray);
        span.y = min(span.y, farthest);
        if (!(span.y > span.x) || span.y <= done) continue;
        if (count == MOST_HITS) {
            // The farthest gives way, or this one is it.
            horizon = min(horizon, max(span.x, spans[MOST_HITS - 1].x));
            if (span.x >= spans[MOST_HITS - 1].x) continue;
            count--;
        }
        uint place = count++;
        passes += AT_ONCE * (place + 1);
        for (; place > 0 && spans[place - 1].x > span.x; place--) {
            spans[place] = spans[place - 1];
            hits[place] = hits[place - 1];
        }
        passes -= AT_ONCE * place;
        spans[place] = span;
        hits[place] = cell;
    }
    return count;
}
