"""Shader source of a profile model, under your name, ready to paste into GLSL.

python examples/02_shader_source.py > skin.glsl
"""

import profilefit
from mcml_sim import Setting
from profilefit.shader import law_text

law = profilefit.load("hazard", setting=Setting("diffuse", n=1.4))
print(law_text(law, lang="glsl", name="skin"))
# `profilefit export hazard-diffuse --n 1.4` also prints errors, illumination and digests as comments.
