"""One pass: samples of a pixel, which begin at its left end."""

from profilefit.scenes.stage.renderer import Pass

LIGHT = "light_map"
SOURCE = """
uniform float k, columns;
uniform int samples;
out vec4 light;
void main() {
    float sum = 0.0;
    for (int i = 0; i < samples; ++i) sum += exp(-k * (floor(gl_FragCoord.x) + float(i) / float(samples)) / columns);
    light = vec4(sum / float(samples));
}
"""


def faded(k, size, samples):
    return Pass("faded", {}, LIGHT, SOURCE, {"k": k, "columns": float(size[0]), "samples": samples})
