"""The one error a user is meant to read."""


class InputError(Exception):
    """What the user gave cannot be used; the message says what, why and what to do.

    Args:
        subject: The input at fault, as the user knows it: a file, a folder, a name, a setting.
        problem: What is wrong with it.
        remedy: What the user can do about it.
    """

    def __init__(self, subject: str, problem: str, remedy: str) -> None:
        super().__init__(subject, problem, remedy)
        self.subject, self.problem, self.remedy = subject, problem, remedy

    def __str__(self) -> str:
        return f"{self.subject}: {self.problem}. {self.remedy}."


class NetworkError(InputError):
    """Something elsewhere could not be reached; it may pass by itself."""


class NotFiniteError(Exception):
    """A number stopped being finite; names the stage, the tensor and when."""

    def __init__(self, stage: str, tensor: str, when: str) -> None:
        super().__init__(f"{stage}: {tensor} is not finite at {when}")
