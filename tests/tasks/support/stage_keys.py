"""What decides the keys of a command's stages."""

WORDS = {"scene": "horns", "style": "mosaic", "quality": "draft"}


def key_words(task) -> dict[str, dict]:
    """Returns what decides each stage of the graph, but for its inputs."""
    words = {task.task_family: dict(task.identity_parameters())}
    for stage in task.requires().values():
        words |= key_words(stage)
    return words
