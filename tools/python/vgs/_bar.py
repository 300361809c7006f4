"""A bar of progress, on terminals and in notebooks."""

from __future__ import annotations

import html
import importlib
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from ._errors import usage_error

Progress = Callable[[dict[str, Any]], Any]

WIDTH = 24
#: Seconds between two drawings.
EVERY = 0.2


class Bar:
    """Shows the news of a fit or of baking: on a terminal in one line that is overwritten, in a notebook in one place."""

    def __init__(self, stage: str) -> None:
        self.news: dict[str, Any] = {"stage": stage}
        self.begun = time.monotonic()
        self.drawn = 0.0
        self.handle = _notebook_handle(stage)
        self.terminal = self.handle is None and sys.stderr.isatty()

    def __call__(self, news: dict[str, Any]) -> None:
        if "stage" in news:
            self.news = {"stage": news["stage"], "splats": self.news.get("splats")}
        self.news.update(news)
        if time.monotonic() - self.drawn >= EVERY:
            self._draw()

    def close(self, last: str) -> None:
        """Replaces the bar by a last line."""
        if self.handle is not None:
            self.handle.update(_Line(last))
        elif self.terminal:
            sys.stderr.write(f"\r\x1b[K{last}\n")
            sys.stderr.flush()

    def _draw(self) -> None:
        self.drawn = time.monotonic()
        if self.handle is not None:
            self.handle.update(_Line(self._text()))
        elif self.terminal:
            sys.stderr.write(f"\r\x1b[K{self._text()}")
            sys.stderr.flush()

    def _text(self) -> str:
        share = self.news.get("share")
        parts = [self.news["stage"]]
        if share is not None:
            full = round(WIDTH * share)
            parts.append(f"{'█' * full}{'░' * (WIDTH - full)} {100 * share:3.0f} %")
        if self.news.get("splats"):
            parts.append(f"{self.news['splats']:,} splats")
        if self.news.get("psnr_db") is not None:
            parts.append(f"{self.news['psnr_db']:.1f} dB")
        parts.append(f"{time.monotonic() - self.begun:.0f} s")
        return "  ".join(parts)


@contextmanager
def watched(progress: bool | Progress, first: str) -> Iterator[tuple[Progress | None, Callable[[str], None]]]:
    """What is to be called with news, by the argument ``progress``, and what replaces a bar by a last line."""
    if callable(progress):
        yield progress, lambda last: None
    elif progress not in (True, False):
        raise usage_error(f"progress is {progress!r}", help="give True, False, or a callable that takes a dictionary")
    elif not progress:
        yield None, lambda last: None
    else:
        bar = Bar(first)
        try:
            yield bar, bar.close
        except BaseException:
            bar.close("it has failed")
            raise


class _Line:
    """A line of text as a notebook shows it."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.text)}</pre>"


def _notebook_handle(first: str) -> Any:
    """Returns a place in the output of a notebook's cell, or None outside of notebooks."""
    if "ipykernel" not in sys.modules:
        return None
    return importlib.import_module("IPython.display").display(_Line(first), display_id=True)
