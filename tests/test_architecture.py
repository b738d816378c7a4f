"""docs/architecture.md names files that exist, and what it says is in them."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
FILE = re.compile(r"`((?:styletrf|tasks|pipeline)/[\w/]*(?:\.py)?)`")


def test_every_file_it_names_exists():
    named = FILE.findall(TEXT)
    assert len(named) > 30
    assert [path for path in named if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("row", [line for line in TEXT.splitlines() if line.startswith("| W")])
def test_every_name_in_an_answer_stands_in_a_file_of_that_answer(row: str):
    answer = row.split("|")[2]
    files = [ROOT / path for path in FILE.findall(answer) if path.endswith(".py")]
    code = "".join(path.read_text(encoding="utf-8") for path in files)
    names = re.findall(r"`(\w+)`", answer)
    assert [name for name in names if not re.search(rf"\b{name}\b", code)] == []
