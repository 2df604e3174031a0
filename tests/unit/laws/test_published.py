"""Printed constants, typed here a second time from their sources: the two copies must agree, digit for digit."""

from mcml_sim import Setting
from profilefit.laws.published import SETS

# Liang et al.: (9)-(11) a, (12)-(13) b, (14)-(15) c, (19)-(20) the inverse; (8). Christensen and Burley 2015:
# s = 1.85 - A + 7 |A - 0.8|^3, 1.9 - A + 3.5 (A - 0.8)^2, 3.5 + 100 (A - 0.33)^4. Kulla and Conty 2017:
# s = 4.09712 + 4.20863 A - sqrt(9.59217 + 41.6808 A + 17.7126 A^2). Chiang, Kutz and Burley 2016:
# alpha = 1 - exp(-5.09406 A + 2.61188 A^2 - 4.31805 A^3).
LIANG = "a1 -0.0064 a2 0.00316 a3 30 b0 0.461 b1 6.7 b2 0.45 b3 2.6 b4 1.3 c1 0.0097 c2 4.2 c3 0.166 g1 1.504 g2 2.175 "
LIANG += "g3 0.7 g4 0.19 h1 3.993 h2 3.268 h3 0.2838"
PRINTED = {
    ("liang", "published", "searchlight"): LIANG,
    ("liang", "corrected", "searchlight"): LIANG.replace("b0 0.461", "b0 0.0641"),
    ("burley", "published", "searchlight"): "s0 1.85 s1 1 s2 7 s3 0.8",
    ("burley", "diffuse", "diffuse"): "s0 1.9 s1 1 s2 3.5 s3 0.8",
    ("burley_diffuse_mfp", "published", "searchlight"): "s0 3.5 s1 100 s2 0.33",
    ("liang_albedo", "published", "searchlight"): "p 5.67 q 3.84 w 0.84",
    ("van_de_hulst_albedo", "published", "diffuse"): "p0 4.09712 p1 4.20863 q0 9.59217 q1 41.6808 q2 17.7126",
    ("chiang_albedo", "published", "diffuse"): "e1 -5.09406 e2 2.61188 e3 -4.31805",
}


def test_constants_are_the_printed_ones():
    """Each set once, under its light, and from a source."""
    assert [(s.law, s.name, s.setting) for s in SETS] == [(law, name, Setting(light)) for law, name, light in PRINTED]
    for one, text in zip(SETS, PRINTED.values(), strict=True):
        words = text.split()
        assert one.constants == dict(zip(words[::2], map(float, words[1::2]), strict=True)), one.law
        assert one.source
