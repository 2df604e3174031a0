"""Plain words: short sentences, terms of the field that link to the glossary, tables and code that fit a window."""

import re
from pathlib import Path

import nbformat
import pytest
import typer

from mcml_sim.cli.app import app as mcml_sim_cli
from profilefit import cli
from tests.site.prose import length, sentences

ROOT = Path(__file__).resolve().parents[2]
README, GLOSSARY = ROOT / "README.md", ROOT / "docs/reference/glossary.md"
PAGES = [README, *sorted(path for path in (ROOT / "docs").rglob("*.md") if not {"laws", "_build"} & {*path.parts})]
NAMES = [path.relative_to(ROOT).as_posix() for path in PAGES]
LONG, VERY_LONG = 25, 35  # words
OPENERS = re.compile(r"(What|Of|That of|Those|The same|Where|By|How|As) ")
BANNED = re.compile(
    r"\b(those of|that of|what it leaves|off by|wrong by|aslant|scattered once|light from everywhere|truths?|told|ks|"
    r"rel|cannot tell|asked for|made again|serves?|shader texts?)\b"
)


def helps() -> str:
    """Return the help of every command and option, a paragraph each."""
    programs = [typer.main.get_command(app) for app in (cli.app, mcml_sim_cli)]
    commands = [*programs, *(command for program in programs for command in program.commands.values())]
    texts = [command.help for command in commands]
    texts += [option.help for command in commands for option in command.params if getattr(option, "help", None)]
    blocks = "\n\n".join(filter(None, texts)).split("\n\n")
    return "\n\n".join(block for block in blocks if not block.lstrip("\b\n ").startswith(("profilefit ", "mcml-sim ")))


NOTEBOOKS = {path.stem: nbformat.read(path, 4).cells for path in sorted((ROOT / "notebooks").glob("*.ipynb"))}
TEXTS = {name: path.read_text(encoding="utf-8") for name, path in zip(NAMES, PAGES, strict=True)} | {"help": helps()}
TEXTS |= {name: "\n\n".join(c.source for c in cells if c.cell_type == "markdown") for name, cells in NOTEBOOKS.items()}


def test_sentences_are_short():
    """At most 1 % have over 35 words, and at most 15 % over 25."""
    found = [(name, sentence) for name, text in TEXTS.items() for sentence in sentences(text)]
    assert len(found) > 600
    for words, share in ((VERY_LONG, 0.01), (LONG, 0.15)):
        longer = [f"{name}: {sentence}" for name, sentence in found if length(sentence) > words]
        assert len(longer) <= share * len(found), "\n".join(longer)


@pytest.mark.parametrize("name", TEXTS)
def test_sentences_are_plain(name):
    """No sentence has two colons or semicolons, a banned opener or a banned word."""
    found = sentences(TEXTS[name])
    assert [one for one in found if len(re.findall(r"[:;](?!\w)", one)) > 1] == []
    assert [one for one in found if OPENERS.match(one) or BANNED.search(one)] == []


def test_what_is_banned_is_found():
    text = (
        "One: two; three. What it is. By\nboth, e.g. `a b`. | no\n\n"
        "| a | b |\n\n```\nWhat\n```\n- An item. $x. Y$ is [a\n1](u)."
    )
    found = ["One: two; three.", "What it is.", "By both, e.g. a b. | no", "An item.", "FORMULA is a 1."]
    assert sentences(text) == found
    assert OPENERS.match("By both")
    assert BANNED.search("asked for the same colour")


def test_terms_link_to_the_glossary():
    """A page that uses a term of the glossary links it once."""
    terms = re.findall(r"^### (.+)$", GLOSSARY.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(terms) >= 20
    missing = []
    for name, path in zip(NAMES, PAGES, strict=True):
        prose, text = " ".join(sentences(TEXTS[name])), TEXTS[name]
        used = [term for term in terms if re.search(rf"\b{re.escape(term)}s?\b", prose, re.IGNORECASE)]
        links = {term: f"glossary.md#{term.lower().replace(' ', '-')})" for term in used}
        missing += [(name, term) for term in used if links[term] not in text and path not in (README, GLOSSARY)]
    assert missing == []


@pytest.mark.parametrize("name", NAMES)
def test_tables_and_code_fit_the_window(name):
    """A row of a table has at most 120 characters, a line of code 88; a line of the README 100."""
    lines = TEXTS[name].splitlines()
    code = re.findall(r"^```.*?\n(.*?)^```", TEXTS[name], re.MULTILINE | re.DOTALL)
    assert [line for line in lines if line.startswith("|") and len(line) > 120] == []
    assert [line for block in code for line in block.splitlines() if len(line) > 88] == []
    if name == "README.md":
        assert [line for line in lines if len(line) > 100] == []
        assert len(lines) <= 120
