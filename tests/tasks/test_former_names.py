"""Names of earlier versions, which still work."""

import luigi
import pytest
from expected_errors import rejects
from message_words import mentions

import tasks
from pipeline.execution import gpu
from tasks.presets import former_names
from tasks.summary import webhook
from tasks.summary.report_content import summary_of


def test_the_former_name_of_gpus_sets_their_number(caplog):
    words = {"scene": "s", "style": "p", "content": "embedded", "settings": {"batch": 4}}
    assert tasks.StyleNetwork(**words, gpus=2).max_gpus == 2
    former = tasks.StyleNetwork(**words, cards=2)
    assert former.max_gpus == 2
    former.validate()
    assert mentions(caplog.text, "--StyleNetwork-cards", "--StyleNetwork-gpus")
    assert former.identity_parameters() == tasks.StyleNetwork(**words).identity_parameters()


@pytest.mark.parametrize("section", ["grid", "night"])
def test_a_webhook_may_stand_in_the_former_section(section, caplog, monkeypatch):
    config = luigi.configuration.get_config()
    config.set(section, "webhook", "nowhere")
    try:
        webhook.post_to_webhook({"text": "hello"})
    finally:
        config.remove_section(section)
    assert mentions(caplog.text, "[grid] webhook", "luigi.cfg")
    assert mentions(caplog.text, "[night]") == (section == "night")


@pytest.mark.parametrize("name", ["uuids", "cards"])
def test_gpus_may_be_named_by_the_former_setting(name, caplog, monkeypatch):
    monkeypatch.delenv(gpu.VISIBLE, raising=False)
    config = luigi.configuration.get_config()
    config.set("gpu", name, "GPU-a, GPU-b")
    gpu._warn_of_former_name.cache_clear()
    try:
        assert gpu.visible_gpus() == ["GPU-a", "GPU-b"]
    finally:
        config.remove_section("gpu")
    assert mentions(caplog.text, "[gpu] cards", "[gpu] uuids") == (name == "cards")


def test_a_summary_has_its_parameters_by_the_former_name_too(tmp_path):
    for name in ("summary.json", "support.json"):
        (tmp_path / name).write_text("{}")
    inputs = dict.fromkeys(("quality", "consistency", "resemblance", "trajectory"), tmp_path)
    summary = summary_of({"scene": "s"}, inputs, [])
    assert summary["parameters"] == summary["words"] == {"scene": "s"}


FORMER_SETTINGS = [
    ("CameraPoses", "neighbours", "neighbors", 7),
    ("CameraPoses", "video_neighbours", "video_neighbors", 3),
    ("StyleNetwork", "steadiness.weight", "temporal_loss.weight", 0.5),
]


def stage_with(stage: str, given: str, settings: dict):
    """A stage with settings of `--STAGE-settings`, or of `--tuning`."""
    words = {"scene": "s", "style": "p", "content": "embedded"}
    words |= {"settings": settings} if given == "settings" else {"tuning": {stage: settings}}
    kind = getattr(tasks, stage)
    return kind(**{name: words[name] for name in kind.get_param_names() if name in words})


@pytest.mark.parametrize("given", ["settings", "tuning"])
@pytest.mark.parametrize(("stage", "former", "present", "value"), FORMER_SETTINGS)
def test_a_setting_by_its_former_name_is_that_of_the_present_name(
    stage, former, present, value, given, caplog
):
    former_names._warn_of_former_name.cache_clear()
    renamed = stage_with(stage, given, {former: value})
    assert renamed is stage_with(stage, given, {present: value})
    assert renamed.values()[present] == value
    assert former not in renamed.values()
    (warning,) = caplog.messages
    assert mentions(warning, stage, former, present)


@pytest.mark.parametrize("given", ["settings", "tuning"])
@pytest.mark.parametrize(("stage", "former", "present", "value"), FORMER_SETTINGS)
def test_a_setting_by_both_of_its_names_is_refused(stage, former, present, value, given):
    both = stage_with(stage, given, {former: value, present: value})
    with rejects(stage, present):
        both.validate()
