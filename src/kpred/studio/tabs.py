"""What one tab of the browser shows: the page of a scan; or a room, and the page of one object of it at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from threading import RLock
from typing import Any

from kpred.errors import KpredError
from kpred.studio.opening import Opened
from kpred.studio.page import Page
from kpred.studio.room import RoomSession
from kpred.studio.room_page import RoomPage
from kpred.studio.session import Session
from kpred.studio.state import State
from kpred.studio.upload import MAX_UPLOAD, UploadLimit, read_upload


class Tab(ABC):
    """One tab: what it shows now, until it is closed.

    Args:
        client: viser's.
    """

    def __init__(self, client: Any) -> None:
        self.client = client
        self._turn = RLock()
        self.page: Page | RoomPage | None = None

    @abstractmethod
    def begin(self) -> None:
        """Show the first page."""

    def close(self) -> None:
        """End what is shown."""
        with self._turn:
            if self.page is not None:
                self.page.close()

    def show(self, make: Callable[[], Page | RoomPage]) -> None:
        """Show another page in place of the one before."""
        with self._turn:
            self.close()
            with self.client.atomic():
                self.client.gui.reset()
                self.client.scene.reset()
            self.page = make()


class ScanTab(Tab):
    """A scan; the browser may send others.

    Args:
        session: of this tab alone; name: of the scan's file; limit: bytes of a scan that is sent.
    """

    def __init__(self, client: Any, session: Session, name: str, limit: int = MAX_UPLOAD) -> None:
        super().__init__(client)
        self._session, self._name = session, name
        UploadLimit(client.gui, self._refuse, limit)

    def begin(self) -> None:
        """Show the scan."""
        self.show(lambda: Page(self.client, self._session, self._name, self._controls))

    def _controls(self, page: Page) -> None:
        button = self.client.gui.add_upload_button("Open another scan", hint="A file; it is fitted anew")
        button.on_upload(lambda _: self._open(button.value.name, button.value.content))

    def _open(self, name: str, content: bytes) -> None:
        page, start = self.page, self._session.start
        assert isinstance(page, Page)
        page.note("Reading and fitting the scan ...")
        try:
            plain, points = read_upload(name, content)
            state = State.of(points, start.context, start.options)
        except KpredError as error:
            page.fail(str(error))
            return
        self._session, self._name = Session(state), plain
        self.begin()

    def _refuse(self, sentence: str) -> None:
        if isinstance(self.page, Page):
            self.page.fail(sentence)


class RoomTab(Tab):
    """A room: all of it, or one object that is corrected.

    Args:
        room: its session, of this tab alone.
    """

    def __init__(self, client: Any, room: RoomSession) -> None:
        super().__init__(client)
        self.room = room
        UploadLimit(client.gui, lambda _: None, 0)

    def begin(self) -> None:
        """Show all of the room."""
        self.show(lambda: RoomPage(self.client, self.room, self.open))

    def open(self, name: str) -> None:
        """Show one object, to be corrected."""
        session = self.room.session(name)
        self.show(lambda: Page(self.client, session, name, lambda page: self._controls(name)))

    def _controls(self, name: str) -> None:
        gui = self.client.gui
        gui.add_button("Back to the room").on_click(lambda _: self.begin())
        kept = gui.add_checkbox("In the room", name not in self.room.left_out, hint="Or leave the object out")
        kept.on_update(lambda _: self.room.leave_out(name, not kept.value))


def scan_tabs(opened: Opened) -> Callable[[Any], Tab]:
    """Return what makes the tabs of a scan, all beginning with the same state.

    Raises:
        KpredError: a gesture of the record cannot be done.
    """
    session = Session.replay(opened.start, opened.gestures)
    return lambda client: ScanTab(client, session.copy(), opened.name)


def room_tabs(room: RoomSession) -> Callable[[Any], Tab]:
    """Return what makes the tabs of a room, all beginning with the same corrections."""
    return lambda client: RoomTab(client, room.copy())
