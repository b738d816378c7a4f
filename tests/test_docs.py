"""The documentation: its links and paths lead to files, and its example of the library runs."""

import re
import runpy
from configparser import ConfigParser
from pathlib import Path

import pytest
from source_names import names_of, strings_of

from pipeline.command import INTERRUPTED, INVALID
from styletrf.files.video_frames import video_info
from styletrf.trajectory.support_config import SupportConfig
from tasks.summary.grid_summary import EXIT_STATUS

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "benchmarks/README.md"])
HISTORY = [ROOT / "CHANGELOG.md", *(ROOT / "docs/decisions").glob("*.md")]
CURRENT_PAGES = [page for page in PAGES if page not in HISTORY]
"""The pages that describe the present code."""
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
CODE_PATH = r"(?:styletrf|pipeline|tasks|tests|benchmarks|docs)/[\w./-]*"
CODE_FILE = re.compile(rf"`({CODE_PATH})`")
NAME_IN_FILE = re.compile(rf"(?:`([\w.]+)` of )?`([\w.]+)` in `({CODE_PATH}\.py)`")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_relative_link_leads_to_a_file(page: Path):
    targets = LINK.findall(page.read_text(encoding="utf-8"))
    own = [target for target in targets if "://" not in target]
    assert [target for target in own if not (page.parent / target).exists()] == []


def test_links_of_the_site_stay_in_the_site():
    """Else `make docs` fails."""
    site = (ROOT / "docs").resolve()
    for page in (page for page in PAGES if site in page.parents):
        targets = [t for t in LINK.findall(page.read_text(encoding="utf-8")) if "://" not in t]
        assert [t for t in targets if site not in (page.parent / t).resolve().parents] == [], page


@pytest.mark.parametrize("page", CURRENT_PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_path_of_code_exists(page: Path):
    paths = CODE_FILE.findall(page.read_text(encoding="utf-8"))
    assert [path for path in paths if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("page", CURRENT_PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_name_in_a_file_of_code_is_there(page: Path):
    for *names, path in NAME_IN_FILE.findall(page.read_text(encoding="utf-8")):
        parameters = strings_of(ROOT / path) if path.startswith("tests/") else set()
        parts = {part for name in names for part in name.split(".") if part}
        assert parts - names_of(ROOT / path) - parameters == set(), path


def test_every_page_is_in_the_navigation_of_the_site():
    lines = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").splitlines()
    listed = {line.rpartition(": ")[2] for line in lines if line.lstrip().startswith("- ")}
    pages = [f"{p.relative_to(ROOT / 'docs')}" for p in PAGES if ROOT / "docs" in p.parents]
    decisions = re.compile(r"decisions/0\d{3}")
    assert [page for page in pages if page not in listed and not decisions.match(page)] == []


def test_the_index_lists_all_pages():
    """So says `styletrf --help`; a page of the API is listed by its overview."""
    listed = LINK.findall((ROOT / "docs/index.md").read_text(encoding="utf-8"))
    pages = [path.name for path in (ROOT / "docs").glob("*.md") if path.name != "index.md"]
    assert sorted({*pages, "decisions/README.md", "api/index.md"} - set(listed)) == []


def test_the_exit_statuses_are_those_that_a_command_can_end_with():
    """Luigi's status of an input that no task builds was among them; every stage is built."""
    config = ConfigParser()
    config.read(ROOT / "luigi.cfg", encoding="utf-8")
    statuses = {name: int(value) for name, value in config["retcode"].items()}
    del statuses["missing_data"]
    own = {0, INVALID, INTERRUPTED, *EXIT_STATUS.values(), 2}  # 2 is that of argparse
    text = (ROOT / "docs/troubleshooting.md").read_text(encoding="utf-8")
    assert {int(n) for n in re.findall(r"^\| (\d+) \|", text, re.M)} == own | {*statuses.values()}


def _row_of_decision(path: Path) -> str:
    """Returns the row of the table that a decision's title and second paragraph ask for."""
    title, _, second = path.read_text(encoding="utf-8").splitlines()[:3]
    ((number, name),) = re.findall(r"^# (\d+)\. (.+)$", title)
    ((date, status),) = re.findall(r"^(\d{4}-\d\d-\d\d), ((?:accepted|superseded).*)$", second)
    assert int(number) == int(path.name[:4])
    return f"| [{number}]({path.name}) | {name} | {date} | {status} |"


def test_the_table_has_the_title_date_and_status_of_every_decision():
    table = (ROOT / "docs/decisions/README.md").read_text(encoding="utf-8").splitlines()
    decisions = sorted((ROOT / "docs/decisions").glob("0*.md"))
    rows = [row for row in table if row.startswith("| [")]
    assert rows == [_row_of_decision(path) for path in decisions]


def test_the_limits_of_support_are_those_of_the_code():
    """Stills were said to be made from 2 % on, which is the limit of another row."""
    text = (ROOT / "docs/paths.md").read_text(encoding="utf-8")
    config = SupportConfig()
    (stills,) = re.findall(r"unsupported pixels is (\d+) % or more", text)
    (narrowed,) = re.findall(r"stays below (\d+) %", text)
    assert int(stills) == round(100 * config.least_for_stills)
    assert int(narrowed) == round(100 * config.most_unsupported)


@pytest.mark.slow
def test_the_example_of_the_library_makes_both_videos(tmp_path: Path):
    example = runpy.run_path(str(ROOT / "docs/examples/library.py"))
    example["main"](tmp_path)
    for name in ("unstylized", "stylized"):
        assert video_info(tmp_path / f"{name}.mp4").frames == 12
    assert (tmp_path / "stylized.mp4").read_bytes() != (tmp_path / "unstylized.mp4").read_bytes()
