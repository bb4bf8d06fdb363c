"""The page of a room: its objects to look at and to choose, and what saves all of it."""

from __future__ import annotations

from collections.abc import Callable
from threading import RLock
from typing import Any

from kpred.errors import KpredError
from kpred.exports.format_table import FORMATS
from kpred.fitting.object_fit import ObjectFit
from kpred.fitting.scene_export import SCENE_EXTENSIONS
from kpred.studio.page import plain_markdown
from kpred.studio.room import RoomSession
from kpred.studio.room_files import alignments_download, objects_download, room_download
from kpred.studio.room_record import room_record
from kpred.studio.room_view import RoomView
from kpred.studio.save_controls import safe_stem


class RoomPage:
    """All of a room in one tab.

    Args:
        client: viser's; room: session of this tab alone; opened: is given the name of an object that was chosen.
    """

    def __init__(self, client: Any, room: RoomSession, opened: Callable[[str], None]) -> None:
        self.client, self.room = client, room
        self._turn = RLock()
        self._opened = opened
        gui = client.gui
        gui.configure_theme(show_share_button=False, show_logo=False, control_layout="fixed", control_width="large")
        items = room.items()
        self._facts, self._message = gui.add_markdown(_described(room, items)), gui.add_markdown("")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Objects"):
            for item in items:
                if item.object.name in room.objects:
                    self._add_object(item)
        with tabs.add_tab("Save"):
            self._add_saving()
        self._view = RoomView(client, room.room, items, self.open)

    def close(self) -> None:
        """End the page."""

    def open(self, name: str) -> None:
        """Show one object."""
        with self._turn:
            try:
                self._message.content = "Working …"
                self._opened(name)
            except KpredError as error:
                self._fail(error)

    def _add_object(self, item: ObjectFit) -> None:
        name = item.object.name
        if name in self.room.left_out:
            label = f"{name} · left out"
        else:
            assert item.fit is not None
            session = self.room.sessions.get(name)
            what = "corrected" if session is not None and session.gestures else item.fit.source.model_id
            label = f"{name[:16]} · {what[:18]} · {item.fit.confidence:.2f}"
        self.client.gui.add_button(label).on_click(lambda _: self.open(name))

    def _add_saving(self) -> None:
        gui, stem = self.client.gui, safe_stem(self.room.name)
        whole = gui.add_dropdown("Format of the room", SCENE_EXTENSIONS, ".glb")
        self._add_download("The room", lambda: room_download(self.room.result(), stem, str(whole.value)))
        self._add_download("Alignments (.csv)", lambda: alignments_download(self.room.result(), stem))
        chosen = gui.add_dropdown("Format of each object", tuple(FORMATS))
        self._add_download("Each object", lambda: objects_download(self.room.result(), stem, str(chosen.value)))
        self._add_download(
            "Record of the session", lambda: (f"{stem}.studio.json", room_record(self.room).encode()),
        )  # fmt: skip

    def _add_download(self, label: str, make: Callable[[], tuple[str, bytes]]) -> None:
        def clicked(event: Any) -> None:
            try:
                name, content = make()
            except KpredError as error:
                self._fail(error)
                return
            self.client.send_file_download(name, content)
            self._message.content = plain_markdown(f"{name} was sent to the browser.")

        self.client.gui.add_button(label).on_click(clicked)

    def _fail(self, error: KpredError) -> None:
        self._message.content = f"**Not done.** {plain_markdown(str(error))}"


def _described(room: RoomSession, items: tuple[ObjectFit, ...]) -> str:
    missing = [item for item in items if item.fit is None and item.object.name not in room.left_out]
    lines = [
        f"**{plain_markdown(room.name)}** · {len(room.objects)} objects fitted, {len(room.left_out)} left out",
        "Click an object, in the list or in the picture, to correct it.",
        *(f"No fit: {plain_markdown(str(item.error))}" for item in missing),
    ]
    return "\n\n".join(lines)
