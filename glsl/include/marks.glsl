// What a pixel's ray meets, as a depth: a device runs no shader for pixels whose mark is on the other side of what is drawn, and lavapipe
// else runs each once for every eight pixels, whatever they are.

const float ALONE_MARK = 0.0;     // the shell, one part at a time
const float NOTHING_MARK = 0.5;
const float INTRICATE_MARK = 1.0; // several parts of it at once

// Where tetrahedra are sorted: nothing more is seen there. Else the mark is 0.
const float SATURATED_MARK = 1.0;
