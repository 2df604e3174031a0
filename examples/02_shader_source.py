"""Shader source: a law with the constants of its record, under a name of your own, ready to paste into GLSL.

python examples/02_shader_source.py > skin.glsl
"""

import profilefit
from mcml_sim import Setting
from profilefit.shader import law_text

law = profilefit.load("hazard", setting=Setting("diffuse", n=1.4))
print(law_text(law, lang="glsl", name="skin"))
# `profilefit export hazard-diffuse --n 1.4` prints the same with the errors, the light and the digests in its head.
