"""Errors of vgs: what happened, to which file, and what to do about it."""

from __future__ import annotations

from . import _vgs


class Error(Exception):
    """An error of vgs.

    Attributes:
        code: A stable code, such as ``"VGS-NII-012"``; ``vgs explain CODE`` says more about it. Texts may change, codes
            do not.
        message: What was found and what was needed.
        help: What to do; may be empty.
        file: The file at fault, or None.
        exit_code: The exit code of the program ``vgs`` for such an error.
    """

    def __init__(self, message: str, code: str, file: str | None = None, help: str = "", exit_code: int = 2):
        super().__init__(message)
        self.message = message
        self.code = code
        self.file = file
        self.help = help
        self.exit_code = exit_code

    def __str__(self) -> str:
        where = f"{self.file}: " if self.file else ""
        code = f" [{self.code}]" if self.code else ""
        return f"{where}{self.message}{code}" + (f"\n{self.help}" if self.help else "")

    def __reduce__(self):  # type: ignore[no-untyped-def]
        return type(self), (self.message, self.code, self.file, self.help, self.exit_code)


class UsageError(Error, ValueError):
    """A wrong argument or hyper-parameter."""


class NothingToDoError(Error, ValueError):
    """The input is valid and there is nothing to do, as with an empty region of interest."""


class BadDataError(Error, ValueError):
    """An input holds something that cannot be used."""


class MissingFileError(Error, FileNotFoundError):
    """An input file is missing."""


class DeviceUnavailableError(Error, RuntimeError):
    """No Vulkan device, or one that lacks what is needed."""


class InternalError(Error, RuntimeError):
    """A fault of vgs, or a fit that diverged."""


class HostMemoryError(Error, MemoryError):
    """Out of memory."""


class CannotCreateError(Error, FileExistsError):
    """An output cannot be created: it exists (``force=True`` replaces it), is read-only, or its folder is missing."""


class ReadWriteError(Error, OSError):
    """Reading or writing failed on the way."""


class TemporaryError(Error, RuntimeError):
    """Device lost or out of its memory: trying again may help."""


def usage_error(message: str, help: str) -> Error:
    """Returns the error of an argument that cannot be used."""
    return _vgs.usage_error(message, help)
