"""What a poor encoding prints: another letter for each, so that columns stay in place."""

import io
import sys

import pytest

from mcml_sim.cli.terminal import NAME, STANDS_FOR, mend_streams

LINE = "α 0.12 ± 0.03 → ▁▅█ √(1 − α) 漢"


@pytest.mark.parametrize(
    ("encoding", "printed"),
    [("utf-8", LINE), ("latin-1", "a 0.12 ± 0.03 > _~# V(1 - a) ?"), ("ascii", "a 0.12 + 0.03 > _~# V(1 - a) ?")],
)
def test_one_letter_for_one(monkeypatch, encoding, printed):
    paper = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(paper, encoding=encoding))
    mend_streams()
    print(LINE, flush=True)
    assert paper.getvalue().decode(encoding) == printed + "\n"
    assert len(printed) == len(LINE)


def test_every_letter_has_one_in_ascii():
    assert all(len(text) == 1 and text.isascii() for text in STANDS_FOR.values())


def test_what_cannot_be_read_is_not_spelled():
    with pytest.raises(UnicodeDecodeError, match="can't decode byte"):
        b"\xff".decode("utf-8", NAME)
