"""Progress bars of long commands: done, speed, time left; on standard error, so that results can be piped."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress


class ProgressBar:
    """Progress bars, one a task, shown in terminals only."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeRemainingColumn,
        )

        self._tasks: dict[str, int] = {}
        console = Console(stderr=True)
        self._progress: Progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=12),
            MofNCompleteColumn(),
            TextColumn("{task.fields[speed]}"),
            TimeRemainingColumn(elapsed_when_finished=True),
            TextColumn("{task.fields[note]}"),
            console=console,
            disable=not console.is_terminal,
        )

    def __enter__(self) -> ProgressBar:
        self._progress.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._progress.stop()

    def update(self, task: str, done: int, total: int | None = None, note: str = "") -> None:
        """Show that `done` of `total` of a task are done."""
        from rich.progress import TaskID

        if task not in self._tasks:
            self._tasks[task] = int(self._progress.add_task(task, total=total, completed=done, speed="", note=""))
        number = TaskID(self._tasks[task])
        rate = self._progress.tasks[number].speed
        speed = f"{rate:.1f} it/s" if rate else ""
        self._progress.update(number, completed=done, total=total, speed=speed, note=note)
