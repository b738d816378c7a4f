"""The one error a user is meant to read."""


class InputError(Exception):
    """An input of the user is invalid; the message names it, the reason and the remedy.

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
    """A number stopped being finite.

    Args:
        stage: Which computation is at fault.
        tensor: The first that is not finite, in the order in which they cause each other.
        where: The input that it came of, such as "in view 0003" or "at iteration 12".
    """

    def __init__(self, stage: str, tensor: str, where: str) -> None:
        super().__init__(stage, tensor, where)
        self.stage, self.tensor, self.where = stage, tensor, where

    def __str__(self) -> str:
        return f"{self.stage}: {self.tensor} is not finite {self.where}"
