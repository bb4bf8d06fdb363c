"""The page of one tab: a session, what it shows, and the controls beside it."""

from __future__ import annotations

from collections.abc import Callable
from threading import RLock
from typing import Any

import numpy as np

from kpred.errors import KpredError
from kpred.fitting.result import Fit
from kpred.rendering.deviations import Deviations
from kpred.studio.fit_controls import FitControls
from kpred.studio.gestures import WHOLE, Crop, Gesture, Vector
from kpred.studio.live_drag import LiveDrag, Motion
from kpred.studio.save_controls import SaveControls
from kpred.studio.scene_view import SceneView
from kpred.studio.session import Session
from kpred.studio.shape import Shape
from kpred.studio.shape_controls import ShapeControls
from kpred.studio.state import State
from kpred.studio.thumbnails import candidate_thumbnails, thumbnail_sheet


class Page:
    """One tab; its callbacks come from several threads and take turns.

    Args:
        client: viser's; session: of this tab alone; name: of the scan's file, or of the object.
        add_controls: adds controls at the top.
    """

    def __init__(
        self, client: Any, session: Session, name: str, add_controls: Callable[[Page], None] | None = None
    ) -> None:
        self.client, self.session, self.name = client, session, name
        self.keypoint: int | None = None
        self._turn = RLock()
        self._thumbnails: tuple[Fit, list[np.ndarray]] | None = None
        self._drag = LiveDrag(session, self._follow, self._dropped, self.fail)
        with self._turn:
            gui = client.gui
            gui.configure_theme(show_share_button=False, show_logo=False, control_layout="fixed", control_width="large")
            if add_controls is not None:
                add_controls(self)
            self._facts, self._message = gui.add_markdown(""), gui.add_markdown("")
            steps = gui.add_button_group("History", ("Undo", "Redo"))
            steps.on_click(lambda _: self._step(steps.value))
            tabs = gui.add_tab_group()
            with tabs.add_tab("Fit"):
                self.fit = FitControls(self)
            with tabs.add_tab("Shape"):
                self.shape = ShapeControls(self)
            with tabs.add_tab("Save"):
                self._save = SaveControls(self)
            self.view = SceneView(client, self.select, self._moved)
            self.refresh()

    @property
    def state(self) -> State:
        """What the tab shows."""
        return self.session.state

    def close(self) -> None:
        """End the tab: nothing of it is left."""
        self._drag.close()

    def do(self, gesture: Gesture) -> None:
        """Do a gesture and show the result, or the sentence of its error."""
        with self._turn:
            self._message.content = "Working …"
            try:
                self.session.do(gesture)
            except KpredError as error:
                self.fail(str(error))
                self.refresh(keep_message=True)
                return
            except Exception as error:
                self.fail(f"An error of kpred itself ({type(error).__name__}); the terminal shows it. Try another way.")
                raise
            self.refresh()

    def fail(self, sentence: str) -> None:
        """Show an error in one sentence."""
        self._message.content = f"**Not done.** {plain_markdown(sentence)}"

    def note(self, sentence: str) -> None:
        """Show what was done."""
        self._message.content = plain_markdown(sentence)

    def select(self, keypoint: int | None) -> None:
        """Give a keypoint the handle."""
        with self._turn:
            self.keypoint = keypoint
            self.refresh(keep_message=True)

    def refresh(self, keep_message: bool = False) -> None:
        """Show the state of the session."""
        with self._turn, self.client.atomic():
            state, fit = self.state, self.state.fit
            points = fit.frame.to_unit(state.points)
            deviations = Deviations.measure(points, state.shape.vertices, np.asarray(fit.mesh.faces))
            if not keep_message:
                self._message.content = ""
            self._facts.content = self._described(state, deviations)
            self.fit.refresh(state)
            self.shape.refresh(state)
            axis, part = self.shape.axis, self.shape.part
            self.view.show(state, deviations, self.keypoint, axis, part if part != WHOLE else -1)
            self.shape.show_layers()

    def sheet(self, state: State) -> np.ndarray:
        """Draw the thumbnails of the candidates; they are kept until another search."""
        searched = state.searched
        if self._thumbnails is None or self._thumbnails[0].candidates is not searched.candidates:
            self._thumbnails = searched, candidate_thumbnails(searched)
        ids = [one.model_id for one in state.candidates]
        chosen = state.fit.source.model_id
        return thumbnail_sheet(self._thumbnails[1], ids.index(chosen) if chosen in ids else None)

    def crop(self) -> None:
        """Keep the points inside of the box that is shown."""
        box = self.fit.box
        if box is None:
            self.fail("Show the box first, and drag its two corners.")
            return
        frame = self.state.fit.frame
        # The same box in coordinates of the scan, along the object's axes.
        middle = frame.rotation @ frame.center
        low, high = (_vector(corner * frame.scale + middle) for corner in box.corners())
        x, y, z = (_vector(row) for row in frame.rotation)
        self.do(Crop(low, high, (x, y, z)))

    def _step(self, name: str) -> None:
        with self._turn:
            if name == "Undo":
                self.session.undo()
            else:
                self.session.redo()
            self.refresh()

    def _moved(self, place: np.ndarray) -> None:
        if self.keypoint is not None:
            outside = self.state.fit.frame.from_unit(place)
            self._drag.move(Motion(self.keypoint, outside, self.shape.mirror, self.shape.axis))

    def _follow(self, state: State, shape: Shape) -> None:
        with self._turn:
            self.view.follow(state, shape)
        self.client.flush()

    def _dropped(self, state: State) -> None:
        self.refresh()

    def _described(self, state: State, deviations: Deviations) -> str:
        fit = state.fit
        step = "corrected by hand" if state.corrected else fit.source.step
        lines = [
            f"**{plain_markdown(fit.source.model_id)}** · {fit.category} · {step} · confidence {fit.confidence:.2f}",
            deviations.sentence(fit.frame.scale * fit.unit.metres * 100.0),
            *(f"Note: {plain_markdown(warning)}" for warning in fit.warnings),
        ]
        return "\n\n".join(lines)


def plain_markdown(text: str) -> str:
    """Make text that Markdown shows as it is: names of models and files may hold anything."""
    clean = "".join(letter if letter.isprintable() else " " for letter in text)
    return "".join(f"\\{letter}" if letter in "\\`*_{}[]()<>#+-!|~$&" else letter for letter in clean)


def _vector(row: np.ndarray) -> Vector:
    x, y, z = (float(value) for value in row)
    return x, y, z
