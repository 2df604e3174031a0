"""Sentences of pages as a reader meets them: without blocks of code, tables, headings, formulas and pictures."""

import re

BLOCKS = (r"^```.*?^```", r"^\$\$.*?^\$\$", r"\$\$.*?\$\$", r"<!--.*?-->")
LINES = (r"^\s*\|.*$", r"^#.*$", r"^</?\w+[^>]*>$")
INLINE = ((r"!\[[^\]]*\]\([^)]*\)", ""), (r"\[([^\]]*)\]\([^)]*\)", r"\1"), (r"\$[^$\n]+\$", "FORMULA"))
END = re.compile(
    r"(?<!\be\.g\.)(?<!\bi\.e\.)(?<!\bal\.)(?<!\bFig\.)(?<!\bEq\.)(?<=[.!?])[\"')*_`]*\s+(?=[\"'(*_`]*[A-Z])"
)
ITEM = re.compile(r"\n\s*\n|\n(?=\s*(?:[-*+]|\d+\.)\s)")


def sentences(text: str) -> list[str]:
    """Return the sentences of a page in Markdown. A sentence begins with a capital letter; words of code count."""
    for pattern in BLOCKS:
        text = re.sub(pattern, "\n\n", text, flags=re.MULTILINE | re.DOTALL)
    for pattern in LINES:
        text = re.sub(pattern, "", text, flags=re.MULTILINE)
    for pattern, kept in INLINE:
        text = re.sub(pattern, kept, text, flags=re.DOTALL)
    blocks = (" ".join(block.replace("`", "").split()) for block in ITEM.split(text))
    found = (part.strip(" *_-") for block in blocks for part in END.split(block))
    return [part for part in found if length(part) > 1]


def length(sentence: str) -> int:
    """Return the number of words of a sentence: parts with a letter or a digit."""
    return sum(re.search(r"\w", word) is not None for word in sentence.split())
