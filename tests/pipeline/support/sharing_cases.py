"""What tests of sharing have in common."""

import json

import luigi

from pipeline.maintenance.command_line import main
from pipeline.maintenance.verify import problems
from pipeline.store import Store
from pipeline.task import StoredTask


def build(*tasks: StoredTask) -> bool:
    return luigi.build(tasks, local_scheduler=True, logging_conf_file="")


def command(capsys, *arguments: str) -> tuple[int, list[dict[str, object]]]:
    """Status and rows of `python -m pipeline ... --json`."""
    capsys.readouterr()
    status = main([*arguments, "--json"])
    said = capsys.readouterr()
    return status, json.loads(said.out) if status < 2 else said.err


def objects(store: Store) -> list[str]:
    return sorted(path.name for path in (store.root / "objects").glob("*/*"))


def is_whole(store: Store) -> bool:
    return not list(problems(store, deep=True))


def flipped(content: bytes, record) -> bytes:
    return content.replace(b"hello", b"jello")
