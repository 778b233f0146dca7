// What a pixel's ray meets, as a depth: a device runs no shader for pixels that are marked by another, and lavapipe else runs each once
// for every eight pixels, whatever they are.

const float NOTHING_MARK = 0.0;
const float ALONE_MARK = 0.5;     // the shell, one part at a time
const float INTRICATE_MARK = 1.0; // several parts of it at once
