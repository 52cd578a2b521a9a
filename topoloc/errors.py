"""What a user can do wrong, each with the place and what to do instead; the command line prints it as one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def one_line(error: BaseException | str) -> str:
    """What went wrong as one line: a user's mistake in its own words, anything else after its kind."""
    kind = f"{type(error).__name__}: " if isinstance(error, BaseException) and not isinstance(error, UserError) else ""
    return f"{kind}{' '.join(str(error).split())}".removesuffix(": ")


class UserError(Exception):
    """A mistake of the user's. Its text is one line that says what is wrong and what to do; exit code 2."""

    def __reduce__(self) -> tuple[Any, ...]:
        """So that it comes back whole from another process, whatever its subclass asks for when it is made."""
        return _restored, (type(self), self.args, self.__dict__)


def _restored(kind: type[UserError], args: tuple[Any, ...], state: dict[str, Any]) -> UserError:
    error = kind.__new__(kind)
    error.args = args
    error.__dict__.update(state)
    return error


class InputError(UserError):
    """A file or folder that cannot be used.

    Args:
        path: the file or folder.
        problem: what is wrong with it.
        remedy: what to do about it.
        line: 1-based line in the file, where there is one.
    """

    def __init__(self, path: Path | str, problem: str, remedy: str, line: int | None = None) -> None:
        self.path, self.problem, self.remedy, self.line = Path(path), problem, remedy, line
        place = f"{path}, line {line}" if line is not None else f"{path}"
        super().__init__(f"{place}: {problem}; {remedy}")


class UnreadableImage(InputError):
    """An image file that does not decode: a blind frame in the middle of a run, an error in a map."""


class UnknownName(UserError):
    """A sensor, estimator, world or setting that does not exist."""

    def __init__(self, what: str, name: str, known: list[str]) -> None:
        super().__init__(f"no {what} is called {name!r}; choose from: {', '.join(known) or 'none is installed'}")


class OutputExists(UserError):
    """A place to write to that already holds something."""

    def __init__(self, path: Path | str) -> None:
        super().__init__(f"{path}: already exists; name another place, or add --overwrite to replace what it holds")
