#version 450
// What the device makes of places between two levels of detail, the first of which holds 0 and the second 1.

layout(set = 0, binding = 8) uniform sampler3D volume;

layout(location = 0) out vec4 out_rgba; // what it reads, what that should be, 0, 1

void main() {
    float level = fract(0.61803399 * gl_FragCoord.x);
    out_rgba = vec4(textureLod(volume, vec3(0.5), level).x, level, 0.0, 1.0);
}
